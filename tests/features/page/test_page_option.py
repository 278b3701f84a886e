from __future__ import annotations

import socket
import sys
from contextlib import closing
from pathlib import Path
from urllib.request import urlopen

import pytest
from structlog.testing import capture_logs

from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.errors import InvalidArgument, OperationError
from robotd.feature_host import open_features
from robotd.plugin.manager import load_backend
from robotd.robot import Robot


def robot(folder: Path, *overrides: str) -> Robot:
    values = [f"recorder.folder={folder}", *overrides]
    descriptor = load_robot_descriptor("cr3a", overrides=[*map(parse_override, values)])
    return Robot(descriptor, load_backend("sim"), SteppedClock())


def free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_the_descriptor_serves_a_page(tmp_path: Path) -> None:
    port = free_port()
    with (
        open_features(robot(tmp_path, f"page={port}"), ["a_node"]),
        urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30) as answer,
    ):
        assert b"robotd_ready 0.0" in answer.read()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), 5)


def test_the_page_works_without_the_recorder(tmp_path: Path) -> None:
    port = free_port()
    lines: list[str] = []
    made = robot(tmp_path, f"page={port}", "recorder.enabled=false")
    with open_features(made, say=lines.append) as features:
        assert "recorder" not in features.parts
        for task in features.on_ready:
            task()
        assert lines == [f"page http://127.0.0.1:{port}/"]
        urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30).close()


@pytest.mark.parametrize("has_control", [False, True])
def test_control_is_off_unless_it_is_asked_for(tmp_path: Path, has_control: bool) -> None:
    shown: list[str] = []
    made = robot(tmp_path, "page=0", *(["page_control=true"] if has_control else []))
    with capture_logs() as lines, open_features(made, say=shown.append) as features:
        for task in features.on_ready:
            task()
        address, _, token = shown[0].removeprefix("page ").split()[0].partition("#token=")
        assert bool(token) is has_control
        assert ("keep it to yourself" in shown[0]) is has_control
        log = str(lines)
        assert address in log
        assert not token or token not in log


def test_control_needs_a_page(tmp_path: Path) -> None:
    with (
        pytest.raises(InvalidArgument, match="page_control needs a page: --page PORT"),
        open_features(robot(tmp_path, "page_control=true")),
    ):
        pass


def test_without_aiohttp_the_error_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "robotd_page.page_server", None)
    with (
        pytest.raises(OperationError, match=r"pip install 'robotd\[page\]'"),
        open_features(robot(tmp_path, "page=0")),
    ):
        pass
