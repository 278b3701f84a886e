"""A broken plugin in a real ``robotd``: told with its name and origin, and nothing moves."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from tests.features.conformance.runs import broken
from tests.features.conformance.runs.conftest import InstallMutant, InstallSource
from tests.features.conformance.runs.mutants.plugin import Mutant
from tests.ros.robot_process import Client, Goal, RobotProcess, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.srv import GetIoBit, SetIoBit

from robotd.cli.exit_codes import ExitCode

pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")  # old lark in ROS

BROKEN = "tests.features.conformance.runs.broken"
ORIGIN = "plugin 'odd' (odd_module of odd 1.0)"
IMPORTS = "from robotd.api import BackendInfo, Capability, hookimpl\n"
INFO = """
@hookimpl
def robotd_backend():
    return BackendInfo(summary="", %s)
"""


@pytest.mark.daily
@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("import not_there", "cannot be imported: ModuleNotFoundError"),
        (IMPORTS + INFO % "api_version=7", "is written for robotd plugin API 7, this is API 1"),
        (IMPORTS + "@hookimpl\ndef robotd_bakend(): ...", "unknown hook 'robotd_bakend'"),
        (IMPORTS + "@hookimpl\ndef robotd_axes(devise): ...", "devise"),
        (IMPORTS + "@hookimpl\ndef robotd_backend(): 1 / 0", "robotd_backend failed: ZeroDivision"),
        (
            IMPORTS
            + INFO % "api_version=1"
            + "@hookimpl\ndef robotd_open_device(): raise OSError('no licence')",
            "robotd_open_device failed: OSError: no licence",
        ),
    ],
)
def test_a_plugin_that_does_not_start_is_told_with_its_origin(
    source: str, says: str, install_source: InstallSource
) -> None:
    install_source(source)
    command = [sys.executable, "-m", "robotd", "--robot", "standalone", "--backend", "odd"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=90)
    assert done.returncode == ExitCode.PLUGIN, done.stdout + done.stderr
    assert ORIGIN in done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr


@pytest.fixture
def switch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file that breaks a backend."""
    path = tmp_path / "break"
    monkeypatch.setenv(broken.BREAK, str(path))
    return path


@contextmanager
def served(name: str) -> Iterator[tuple[RobotProcess, Client]]:
    with RobotProcess(backend=name) as process:
        process.wait_ready()
        client = Client(process.domain)
        try:
            client.wait_engine()
            yield process, client
        finally:
            client.close()


def send_goal(client: Client, time_s: int = 20, feedback: list[Any] | None = None) -> Goal:
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = [f"joint{number}" for number in range(1, 7)]
    point = JointTrajectoryPoint(positions=[0.5] * 6)
    point.time_from_start.sec = time_s
    goal.trajectory.points = [point]
    return client.send_goal(goal, feedback)


def begin_goal(client: Client) -> Goal:
    """Send a goal and wait until its motion has begun."""
    feedback: list[Any] = []
    sent = send_goal(client, feedback=feedback)
    wait_until(lambda: feedback, "the motion of the goal")
    return sent


def rejection(goal: Goal) -> str:
    """Return the reason of the failure; there must be one."""
    result = goal.result()[1]
    assert result.error_code != FollowJointTrajectory.Result.SUCCESSFUL
    return str(result.error_string)


@pytest.mark.parametrize(
    ("backend", "ended", "rejected"),
    [
        (
            broken.RaisesInRead,
            "installed:RaisesInRead of RaisesInRead 1.0): AxisDriver.read failed: ZeroDivision",
            "",
        ),
        (
            broken.HangsInRead,
            f"{BROKEN}: HangsInRead.Axes.read, line",
            "",
        ),
        (
            broken.HangsInState,
            f"{BROKEN}: HangsInState.Device.state, line",
            "",
        ),
        (broken.HangsInFault, "ms old", "DeviceDriver.fault does not return"),
    ],
    ids=lambda value: value.__name__ if isinstance(value, type) else "",
)
def test_a_driver_that_breaks_ends_all_motion_and_the_daemon_lives(
    backend: type[Mutant], ended: str, rejected: str, switch: Path, install_mutant: InstallMutant
) -> None:
    with served(install_mutant(backend)) as (process, client):
        running = begin_goal(client)
        switch.touch()
        assert ended in rejection(running)
        client.wait_engine(ready=False)
        said = rejection(send_goal(client))
        assert "engine is not ready (state Unknown)" in said
        assert rejected in said
        assert process.end() == ExitCode.SERVOS_NOT_OFF, process.output  # the driver says nothing


def test_an_output_that_hangs_holds_up_nothing_else(install_mutant: InstallMutant) -> None:
    with served(install_mutant(broken.HangsInWrite)) as (process, client):
        outputs = client.node.create_client(SetIoBit, "/wmx/io/set_output_bit")
        assert outputs.wait_for_service(10.0)
        pending = outputs.call_async(SetIoBit.Request(byte=0, bit=0, value=1))
        result = send_goal(client, time_s=1).result()[1]
        assert result.error_code == FollowJointTrajectory.Result.SUCCESSFUL, result.error_string
        assert not pending.done()
        assert process.end() == ExitCode.OK, process.output


def test_inputs_that_hang_stop_the_robot_because_nobody_else_can(
    install_mutant: InstallMutant,
) -> None:
    with served(install_mutant(broken.HangsInInputs)) as (process, client):
        inputs = client.node.create_client(GetIoBit, "/wmx/io/get_input_bit")
        assert inputs.wait_for_service(10.0)
        begin_goal(client)
        inputs.call_async(GetIoBit.Request(byte=0, bit=0))
        process.wait_output("ROS hangs")
        process.wait_output("at rest")
        assert f"{BROKEN}: HangsInInputs.Io.read_inputs, line" in process.output
        assert process.end() == ExitCode.OK, process.output
        assert "servos off" in process.output
        assert "a ROS handler hangs; its thread is abandoned" in process.output
