"""End of the process while the middleware hangs; the exit status is kept."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from tests.ros.robot_process import RobotProcess

pytestmark = pytest.mark.ros

# Like Fast DDS's destroy_participant that spins: PyDLL keeps the interpreter during the call.
HANG = """\
import ctypes, sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            sys.meta_path.remove(self)
            from rclpy.node import Node
            Node.destroy_node = lambda node: ctypes.PyDLL(None).sleep(3600)
            {without}
        return None

sys.meta_path.insert(0, Finder())
"""
WITHOUT_TIMER = "import robotd_ros.middleware as m; m.exit_after = lambda *_: True"
FAILING = """\
schema: 1
name: failing
axes: 1
engine: {open_tries: 1}
nodes: [wmx_io_node]
backends: {sim: {fail_open: 1000}}
"""


@pytest.fixture
def hang(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A ``sitecustomize`` that makes the destruction of every node hang in native code."""
    file = tmp_path / "sitecustomize.py"
    file.write_text(HANG.format(module="robotd_ros.serve", without="pass"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return file


@pytest.mark.usefixtures("hang")
def test_a_middleware_that_hangs_does_not_keep_the_process(tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    with RobotProcess("--report", str(report)) as process:
        process.wait_ready()
        assert process.end(signal.SIGTERM) == 0
        assert "device closed" in process.output
        assert report.stat().st_size > 0


@pytest.mark.usefixtures("hang")
def test_the_status_of_a_failed_start_is_kept(tmp_path: Path) -> None:
    robot = tmp_path / "failing" / "robot.yaml"
    robot.parent.mkdir()
    robot.write_text(FAILING)
    with RobotProcess(robot=str(robot), backend="sim") as process:
        assert process.exit_status() == 5


def test_without_the_timer_only_sigkill_ends_the_process(hang: Path) -> None:
    hang.write_text(HANG.format(module="robotd_ros.serve", without=WITHOUT_TIMER))
    with RobotProcess() as process:
        process.wait_ready()
        process.process.send_signal(signal.SIGTERM)
        process.wait_output("device closed")
        for _ in range(2):
            process.process.send_signal(signal.SIGTERM)
            with pytest.raises(subprocess.TimeoutExpired):
                process.process.wait(6.0)
        process.process.kill()


@pytest.mark.parametrize(
    ("arguments", "status", "text"),
    [
        (("speed", "100"), 0, "100 %"),
        (("move", "joint1=99"), 1, "position 99 rad exceeds"),
        (("output", "nothing", "on"), 1, "nothing"),
    ],
    ids=["success", "rejected goal", "rejected call"],
)
def test_a_command_has_printed_all_and_keeps_its_status(
    cr3a: RobotProcess, hang: Path, arguments: tuple[str, ...], status: int, text: str
) -> None:
    hang.write_text(HANG.format(module="robotd_ros.client.ros_client", without="pass"))
    command = subprocess.run(
        [sys.executable, "-m", "robotd", *arguments],
        env=os.environ
        | {"ROS_DOMAIN_ID": str(cr3a.domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert command.returncode == status, command.stderr
    assert text in command.stdout + command.stderr
