"""``robotd stop`` whose output nobody reads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from robotd.cli import main
from robotd_ros.commands import stop_command

PROGRESS = "no robot found yet"


class Request:
    """Stop that is confirmed after three tries."""

    progress = PROGRESS

    def __init__(self, client: object) -> None:
        self.tries = 0

    @property
    def is_done(self) -> bool:
        return self.tries == 3

    def advance(self) -> None:
        self.tries += 1

    def result(self) -> str:
        return "stopped, at rest"

    def close(self) -> None:
        """Nothing was made."""


def test_a_stop_goes_on_when_its_progress_cannot_be_printed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    @contextmanager
    def robot_client(timeout_s: float, *, searches: bool) -> Iterator[SimpleNamespace]:
        yield SimpleNamespace(spin=lambda: None)

    def warn(text: str) -> None:
        assert PROGRESS in text
        raise BrokenPipeError

    monkeypatch.setattr(stop_command, "robot_client", robot_client)
    monkeypatch.setattr(
        stop_command, "import_ros", lambda name: SimpleNamespace(StopRequest=Request)
    )
    monkeypatch.setattr(stop_command, "print_addressed_robots", lambda client: None)
    monkeypatch.setattr(stop_command, "FIRST_REPORT_S", 0.0)
    monkeypatch.setattr(stop_command, "warn", warn)
    result = CliRunner().invoke(main, ["stop"])
    assert (result.exit_code, result.stdout) == (0, "stopped, at rest\n")
