"""ROS starts where it cannot keep log files, and says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotd.log import LogLine, add_listener, remove_listener
from robotd_ros.host import RosHost
from robotd_ros.middleware.log_files import WITHOUT, log_file_arguments

NOWHERE = "/proc/nowhere"  # nobody can make a folder here, root neither


def test_a_folder_that_can_be_written_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    assert log_file_arguments() == ((), "")


@pytest.mark.parametrize("variable", ["ROS_LOG_DIR", "ROS_HOME", "HOME"])
def test_a_host_starts_without_log_files_where_none_can_be_written(
    variable: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROS_LOG_DIR", "ROS_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(variable, NOWHERE)
    arguments, reason = log_file_arguments()
    assert arguments == WITHOUT
    assert reason.startswith(f"{NOWHERE}")
    lines: list[LogLine] = []
    add_listener(lines.append)
    try:
        host = RosHost()
        host.start()
        host.close()
    finally:
        remove_listener(lines.append)
    assert any("ROS keeps no log files" in line.text for line in lines)
