"""All commands work where processes find each other by a Fast DDS discovery server."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator

import pytest
from tests.ros.robot_process import RobotProcess

pytestmark = pytest.mark.ros

TIMEOUT = ("--timeout", "20")  # the server tells new clients of others with its own period


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(scope="module")
def robot() -> Iterator[RobotProcess]:
    """The arm, found by the server only: the servers' protocol replaces multicast."""
    program = shutil.which("fast-discovery-server", path=f"{sys.prefix}/bin:{os.environ['PATH']}")
    assert program, "fast-discovery-server comes with the wheel ros-fastrtps and with ROS"
    port = str(free_udp_port())
    server = subprocess.Popen(
        [program, "-i", "0", "-l", "127.0.0.1", "-p", port],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DISCOVERY_SERVER", f"127.0.0.1:{port}")
        patch.delenv("ROS_SUPER_CLIENT", raising=False)
        try:
            with RobotProcess("--time-scale", "1", backend="sim") as process:
                process.wait_ready()
                yield process
        finally:
            server.kill()
            server.wait()


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (("status",), "Communicating, ready"),
        (("move", "joint1=0.1", "--time", "0.5"), "goal reached"),
        (("gripper", "close"), "gripper closes"),
        (("servo", "on"), "joint6: ok"),
        (("sim", "inject", "amp_alarm", "axis=5"), "amp_alarm"),
        (("sim", "pause"), "time paused"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_a_command_finds_the_robot(
    robot: RobotProcess, command: tuple[str, ...], answer: str
) -> None:
    result = subprocess.run(
        [sys.executable, "-m", "robotd", *command, *TIMEOUT],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env=os.environ | {"ROS_DOMAIN_ID": str(robot.domain)},
    )
    assert result.returncode == 0, result.stderr
    assert answer in result.stdout


def test_without_the_whole_graph_no_robot_is_found(
    robot: RobotProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_SUPER_CLIENT", "FALSE")  # wins over robotd's own choice
    result = subprocess.run(
        [sys.executable, "-m", "robotd", "move", "joint1=0", "--timeout", "6"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env=os.environ | {"ROS_DOMAIN_ID": str(robot.domain)},
    )
    assert result.returncode == 5
    assert "no robot found within 6 s" in result.stderr
    assert "ROS_DISCOVERY_SERVER=127.0.0.1:" in result.stderr
