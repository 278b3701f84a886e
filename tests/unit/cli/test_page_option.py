from __future__ import annotations

import socket
import sys
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import click
import pytest
from structlog.testing import capture_logs

from robotd.cli.run_command import RunOptions, _observed, _page_text
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.errors import OperationError
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

NOTHING: dict[str, Any] = dict.fromkeys(
    ("variant", "backend", "nodes", "rate_hz", "report", "time_scale", "scenario", "record")
)


def options(page: int | None, folder: Path, page_control: bool | None = None) -> RunOptions:
    return RunOptions(
        robot="cr3a",
        **NOTHING,
        overrides=(),
        record_dir=folder,
        metrics=None,
        foxglove=None,
        page=page,
        page_control=page_control,
        ros_args=(),
    )


def robot(*overrides: str) -> Robot:
    descriptor = load_robot_descriptor("cr3a", overrides=[*map(parse_override, overrides)])
    return Robot(descriptor, load_backend("sim"), SteppedClock())


def free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_the_descriptor_serves_a_page(tmp_path: Path) -> None:
    port = free_port()
    with (
        _observed(robot(f"page={port}"), ["a_node"], options(None, tmp_path), None),
        urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30) as answer,
    ):
        assert b"robotd_ready 0.0" in answer.read()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), 5)


def test_the_option_wins_and_works_without_the_recorder(tmp_path: Path) -> None:
    port = free_port()
    made = robot("page=9", "recorder.enabled=false")
    with _observed(made, [], options(port, tmp_path), None) as observation:
        assert observation.recorder is not None
        assert observation.page == f"http://127.0.0.1:{port}/"
        urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30).close()


@pytest.mark.parametrize(
    ("in_file", "option", "has_control"),
    [
        ("false", None, False),
        ("false", True, True),
        ("true", None, True),
        ("true", False, False),
    ],
)
def test_control_is_off_unless_the_option_or_the_descriptor_asks_for_it(
    tmp_path: Path, in_file: str, option: bool | None, has_control: bool
) -> None:
    made = robot(f"page_control={in_file}")
    with (
        capture_logs() as lines,
        _observed(made, [], options(0, tmp_path, option), None) as observation,
    ):
        address, _, token = observation.page.partition("#token=")
        assert bool(token) is has_control
        assert ("keep it to yourself" in _page_text(observation.page)) is has_control
        log = str(lines)
        assert address in log
        assert not token or token not in log


def test_control_needs_a_page(tmp_path: Path) -> None:
    with (
        pytest.raises(click.UsageError, match="--page-control needs --page PORT"),
        _observed(robot(), [], options(None, tmp_path, True), None),
    ):
        pass


def test_without_aiohttp_the_error_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "robotd_page.page_server", None)
    with (
        pytest.raises(OperationError, match=r"pip install 'robotd\[page\]'"),
        _observed(robot(), [], options(0, tmp_path), None),
    ):
        pass
