"""Named I/O, jogging by increments and by keys, and tolerances, on one robot of its own."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from robotd_msgs.msg import IoLevels
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from tests.ros.robot_process import LATCHED, WAIT_S, Client, RobotProcess, connected, wait_until
from tests.ros.test_client_commands import robotd
from tests.ros.test_trajectory import goal, pose
from tf2_msgs.msg import TFMessage
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import SetAxis

from robotd_ros.nodes.command_subscription import PAUSE_S
from robotd_ros.operator_messages import LEVELS, read_levels

pytestmark = pytest.mark.ros

RIGHT = b"\x1b[C"
REPEAT_S = 0.03
SERVER = "/follow_joint_trajectory_server"
NAMES = ("inputs.part_present=5.3", "outputs.lamp=5.3", "outputs.horn=5.4")


@pytest.fixture(scope="module")
def arm() -> Iterator[RobotProcess]:
    """An arm whose inputs are wired to its outputs."""
    words = [word for name in (*NAMES, "backends.sim.io_loopback=true") for word in ("--set", name)]
    prefix = ("--ros-args", "-p", "frame_prefix:=cell/")
    with RobotProcess(*words, *prefix, backend="sim", simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def arm_client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        yield client


@pytest.fixture(scope="module")
def joints(arm_client: Client) -> list[Any]:
    return arm_client.listen(JointState, "/joint_states")


def test_inputs_and_outputs_are_served_by_their_names(
    arm: RobotProcess, arm_client: Client
) -> None:
    lamp = arm_client.listen(Bool, "/robotd/outputs/lamp", LATCHED)
    part = arm_client.listen(Bool, "/robotd/inputs/part_present", LATCHED)
    overview = arm_client.listen(IoLevels, f"/{LEVELS}", LATCHED)
    off = {"part_present": False}, {"lamp": False, "horn": False}
    wait_until(lambda: overview and read_levels(overview[-1]) == off, "all levels")
    wait_until(lambda: lamp and part, "the latched levels")
    assert robotd(arm.domain, "output", "lamp", "on")[:2] == (0, "lamp: on\n")
    wait_until(lambda: lamp[-1].data and part[-1].data, "the changed levels")
    report = json.loads(robotd(arm.domain, "status", "--json")[1])
    assert report["inputs"] == {"part_present": True}
    assert report["outputs"] == {"lamp": True, "horn": False}
    response = arm_client.call(SetBool, "/robotd/outputs/lamp", data=False)
    assert (response.success, response.message) == (True, "lamp: off")
    wait_until(lambda: not part[-1].data, "the input is off again")
    code, _, error = robotd(arm.domain, "output", "lmap", "on")
    assert code != 0
    assert "unknown output 'lmap'; did you mean 'lamp'? (available: lamp, horn)" in error


def test_the_payload_is_told_and_shown(arm: RobotProcess) -> None:
    text = "payload: 0.8 kg at x 0, y 0.01, z 0.06 m of the flange\n"
    center = ("--center", "0", "0.01", "0.06")
    assert robotd(arm.domain, "tool", "payload", "0.8", *center)[:2] == (0, text)
    assert robotd(arm.domain, "tool", "payload")[:2] == (0, text)
    code, _, error = robotd(arm.domain, "tool", "payload", "101")
    assert code == 1
    assert "payload: 101 kg, must be 0 or more and 100 kg at most" in error


def test_a_jog_of_a_paused_or_stopped_robot_is_an_error(
    arm: RobotProcess, arm_client: Client
) -> None:
    for stop, allow, reason in (
        ("pause", "resume", "motion is paused. To go on: robotd resume"),
        ("stop", "reset", "by a client of the stop service. When it is safe to move: robotd reset"),
    ):
        assert arm_client.call(Trigger, f"/robotd/{stop}").success
        code, _, error = robotd(arm.domain, "jog", "joint2", "+0.01")
        assert (code, reason in error) == (1, True), error
        assert arm_client.call(Trigger, f"/robotd/{allow}").success


@contextmanager
def keyboard_jog(domain: int, *arguments: str) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """``robotd jog --keys`` and the other end of its terminal."""
    master, slave = pty.openpty()
    environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    process = subprocess.Popen(
        [sys.executable, "-m", "robotd", "jog", "--keys", "--timeout", str(WAIT_S), *arguments],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        env=os.environ | environment | {"TERM": "xterm"},
    )
    os.close(slave)
    try:
        yield process, master
    finally:
        process.kill()
        process.wait()


def screen_until(master: int, text: bytes) -> bytes:
    """Read the terminal until ``text`` was shown."""
    shown = b""
    deadline = time.monotonic() + WAIT_S
    while text not in shown:
        assert time.monotonic() < deadline, shown
        shown += os.read(master, 4096)
    return shown


def hold(master: int, key: bytes, until: Callable[[], Any], shown: bytearray | None = None) -> None:
    """Repeat ``key`` as a terminal does while it is held, and read what is ``shown`` meanwhile."""
    shown = bytearray() if shown is None else shown
    os.set_blocking(master, False)
    deadline = time.monotonic() + WAIT_S
    while not until():
        assert time.monotonic() < deadline, "it does not move"
        os.write(master, key)
        shown += drain(master)
        time.sleep(REPEAT_S)


def drain(master: int) -> bytes:
    try:
        return os.read(master, 65536)
    except OSError:  # nothing to read, or nobody at the other end
        return b""


def jog_until_shown(domain: int, text: bytes) -> None:
    shown = bytearray()
    with keyboard_jog(domain) as (process, master):
        screen_until(master, b"hold to move")
        hold(master, RIGHT, lambda: text in shown, shown)
        os.write(master, b"q")
        wait_until(lambda: has_ended(process, master), "it ends")


def has_ended(process: subprocess.Popen[bytes], master: int) -> bool:
    drain(master)
    return process.poll() is not None


def is_at_rest(joints: list[Any]) -> bool:
    return all(abs(speed) < 1e-3 for speed in joints[-1].velocity)


def test_a_joint_moves_while_a_key_is_held(
    arm: RobotProcess, arm_client: Client, joints: list[Any]
) -> None:
    arm_client.next(joints)
    begin = list(joints[-1].position)
    with keyboard_jog(arm.domain) as (process, master):
        screen_until(master, b"hold to move")
        os.write(master, b"2")
        hold(master, RIGHT, lambda: joints[-1].position[1] > begin[1] + 0.05)
        wait_until(lambda: is_at_rest(joints), "the release stops the joint")
        assert joints[-1].position[0] == pytest.approx(begin[0], abs=1e-3)
        hold(master, b"\x1b[D", lambda: joints[-1].velocity[1] < -0.05)
        os.write(master, b"q")
        wait_until(lambda: has_ended(process, master), "it ends")
        assert process.returncode == 0
        assert is_at_rest(joints)


def test_a_rejected_jog_shows_the_reason_which_is_on_rosout_too(
    arm: RobotProcess, arm_client: Client
) -> None:
    log = arm_client.listen(Log, "/rosout", 100)
    reason = "joint3: servo is off"
    try:
        assert arm_client.call(SetAxis, "/wmx/axis/set_on", index=[2], data=[0]).success
        jog_until_shown(arm.domain, reason.encode())
        ended_s = time.monotonic()
        wait_until(lambda: time.monotonic() - ended_s > PAUSE_S, "the reason is news again")
        jog_until_shown(arm.domain, reason.encode())
        lines = [line for line in log if f"reason={reason}" in line.msg]
        assert lines[-1].name == "robotd.commands"
        assert (lines[-1].level, lines[-1].stamp.sec) >= (Log.WARN, time.time() - WAIT_S)
    finally:
        assert arm_client.call(SetAxis, "/wmx/axis/set_on", index=[2], data=[1]).success


@pytest.mark.parametrize("end", ["lost terminal", "Ctrl-C"])
def test_a_lost_terminal_and_an_interrupt_end_the_motion(
    arm: RobotProcess, arm_client: Client, joints: list[Any], end: str
) -> None:
    with keyboard_jog(arm.domain) as (process, master):
        screen_until(master, b"hold to move")
        hold(master, RIGHT, lambda: joints[-1].velocity[0] > 0.05)
        if end == "Ctrl-C":
            process.send_signal(signal.SIGINT)
            wait_until(lambda: has_ended(process, master), "it ends")
        else:
            os.close(master)
        assert process.wait(WAIT_S) == 130
        arm_client.next(joints)
        assert is_at_rest(joints)


def test_tolerances_are_set_at_run_time_for_the_next_goal(arm_client: Client) -> None:
    def set_parameter(name: str, value: float) -> tuple[bool, str]:
        parameters = [Parameter(f"constraints.{name}", value=value).to_parameter_msg()]
        service = f"{SERVER}/set_parameters"
        [result] = arm_client.call(SetParameters, service, parameters=parameters).results
        return result.successful, result.reason

    there, back = goal((1.0, pose(0.3))), goal((1.0, pose(0.0)))
    assert arm_client.send_goal(there).result()[0] == GoalStatus.STATUS_SUCCEEDED
    successful, reason = set_parameter("joint1.trajectory", -1.0)
    assert (successful, "-1.0 is not a finite number of at least 0" in reason) == (False, True)
    assert set_parameter("joint1.trajectory", 1e-6)[0]
    status, result = arm_client.send_goal(back).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert "exceeds path tolerance" in result.error_string
    assert set_parameter("joint1.trajectory", 0.0)[0]
    assert arm_client.send_goal(back).result()[0] == GoalStatus.STATUS_SUCCEEDED


def test_a_goal_passes_its_last_point_where_the_parameter_allows_it(arm_client: Client) -> None:
    velocity = [0.3, *[0.0] * 5]
    passing = goal((2.0, pose(0.3)))
    passing.trajectory.points[0].velocities = velocity
    there = goal((2.0, pose(0.8)))
    there.trajectory.points[0].velocities = [0.0] * 6
    status, result = arm_client.send_goal(passing).result()
    assert status == GoalStatus.STATUS_ABORTED
    assert "must be 0 (trajectory.allow_nonzero_velocity_at" in result.error_string
    name, service = "allow_nonzero_velocity_at_trajectory_end", f"{SERVER}/set_parameters"
    parameters = [Parameter(name, value=True).to_parameter_msg()]
    [answer] = arm_client.call(SetParameters, service, parameters=parameters).results
    assert answer.successful, answer.reason
    states = arm_client.listen(JointState, "/joint_states")
    status, result = arm_client.send_goal(passing).result()
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert result.error_string.startswith("goal passed after 2.000 s")
    assert arm_client.send_goal(there).result()[0] == GoalStatus.STATUS_SUCCEEDED
    assert states[-1].position[0] == pytest.approx(0.8, abs=0.01)
    assert arm_client.send_goal(passing).result()[0] == GoalStatus.STATUS_SUCCEEDED
    wait_until(lambda: is_at_rest(states), "nothing takes over: the joints come to rest")
    behind = states[-1].position[0] - 0.3
    assert behind == pytest.approx(0.03, abs=0.01)


def test_a_frame_prefix_is_put_before_all_frames(arm_client: Client) -> None:
    states = arm_client.listen(AxisState, "/wmx/axis/state")
    assert arm_client.next(states).header.frame_id == "cell/base_link"
    poses = arm_client.listen(TFMessage, "/robotd/tool_pose")
    (found,) = arm_client.next(poses, lambda message: message.transforms).transforms
    assert found.header.frame_id.startswith("cell/")
    assert found.child_frame_id.startswith("cell/")
