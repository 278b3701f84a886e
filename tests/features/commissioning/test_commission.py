"""``robotd commission`` where it cannot begin; tests/plugins/canopen/bus has the whole of it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode
from robotd_commissioning import commission_command

Robotd = Callable[..., Result]


class Terminal:
    """Stand-in for standard streams that are a terminal."""

    stdin = stdout = property(lambda self: self)

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commission_command, "sys", Terminal())


def test_a_terminal_is_needed(robotd: Robotd) -> None:
    result = robotd("commission", "--robot", "cr3a")
    assert result.exit_code == ExitCode.USAGE
    assert "commissioning needs a terminal" in result.output


@pytest.mark.usefixtures("terminal")
def test_a_backend_without_scale_in_the_descriptor_is_named(robotd: Robotd) -> None:
    result = robotd("commission", "--robot", "cr3a", "--backend", "sim")
    assert result.exit_code == ExitCode.PLUGIN
    assert "the backend sim keeps no scale and direction in the descriptor" in result.output


@pytest.mark.usefixtures("terminal")
def test_an_unknown_joint_is_named_with_the_nearest(robotd: Robotd) -> None:
    result = robotd("commission", "--robot", "cr3a", "--backend", "canopen", "--joint", "joint9")
    assert result.exit_code != ExitCode.OK
    assert "joint9" in result.output
