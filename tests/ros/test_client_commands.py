"""Commands status, move, gripper and servo against a robot in another process."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import pytest
from rclpy.task import Future
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import ACTION, WAIT_S, Client, RobotProcess, wait_until

from robotd.descriptor import load_robot_descriptor
from robotd.descriptor.urdf import read_urdf
from robotd.errors import DeviceTimeout
from robotd_ros.client import motion_client
from robotd_ros.client.ros_client import RosClient
from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros

NOT_ENABLED = ("--nodes", "wmx_engine_node,wmx_core_motion_node")


@contextmanager
def started(domain: int, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A command at work; killed at the end if it still is."""
    environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with subprocess.Popen(
        [sys.executable, "-m", "robotd", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | environment,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def robotd(domain: int, *arguments: str) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command."""
    with started(domain, *arguments) as process:
        output, error = process.communicate(timeout=WAIT_S)
        return process.returncode, output, error


def positions(domain: int) -> list[float]:
    report = json.loads(robotd(domain, "status", "--json")[1])
    return [axis["position"] for axis in report["axes"]]


def test_status_as_json_has_every_axis(cr3a: RobotProcess, client: Client) -> None:
    status, output, _ = robotd(cr3a.domain, "status", "--json")
    report = json.loads(output)
    assert status == 0
    assert (report["state"], report["ready"]) == ("Communicating", True)
    assert [axis["axis"] for axis in report["axes"]] == list(range(6))
    assert all(axis["servo_on"] and not axis["alarm"] for axis in report["axes"])


def test_status_has_the_pose_of_the_tool(cr3a: RobotProcess, client: Client) -> None:
    report = json.loads(robotd(cr3a.domain, "status", "--json")[1])
    (tool,) = report["tools"]
    assert (tool["link"], tool["base"]) == ("link6", "base_link")
    descriptor = load_robot_descriptor("cr3a")
    assert descriptor.urdf is not None
    joints = zip(descriptor.joint_names, report["axes"], strict=True)
    positions = {name: axis["position"] for name, axis in joints}
    frame = read_urdf(descriptor.urdf).pose("link6", positions)
    assert tool["position_m"] == pytest.approx(frame[:3, 3], abs=1e-4)
    rotation = Rotation.from_euler("xyz", tool["rotation_rad"]).as_matrix()
    assert rotation == pytest.approx(frame[:3, :3], abs=1e-3)
    assert Rotation.from_quat(tool["quaternion"]).as_matrix() == pytest.approx(rotation)
    assert "link6 in base_link" in robotd(cr3a.domain, "status")[1]


def test_move_moves_the_named_joints_only(cr3a: RobotProcess, client: Client) -> None:
    wanted = positions(cr3a.domain)
    wanted[1], wanted[5] = 0.17453, -0.34907
    status, output, error = robotd(cr3a.domain, "move", "joint2=10", "joint6=-20", "--deg")
    assert status == 0, error
    assert output.startswith("goal reached")
    assert positions(cr3a.domain) == pytest.approx(wanted, abs=2e-3)
    assert robotd(cr3a.domain, "move", "joint2=0", "joint6=0", "--time", "1")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["move", "joint1=3.3"], "position 3.3 rad exceeds 3.14 rad"),
        (
            ["move", "joint9=0"],
            "unknown joint 'joint9'; did you mean 'joint6'? (available: joint1, ",
        ),
        (["jog", "joint9", "0.1"], "unknown joint 'joint9'; did you mean 'joint6'?"),
        (["servo", "on", "7"], "unknown axis '7' (available: joint1, joint2, "),
        (["servo", "on", "jiont2"], "unknown axis 'jiont2'; did you mean 'joint2'?"),
    ],
)
def test_a_refusal_is_status_1_with_the_reason(
    cr3a: RobotProcess, client: Client, arguments: list[str], reason: str
) -> None:
    status, output, error = robotd(cr3a.domain, *arguments)
    assert (status, output) == (1, "")
    assert error.splitlines()[-1].startswith("robotd: error: ")  # after the name of the robot
    assert reason in error


@pytest.mark.daily
def test_one_servo_can_be_switched(cr3a: RobotProcess, client: Client) -> None:
    assert robotd(cr3a.domain, "servo", "off", "joint6")[:2] == (0, "joint6: ok\n")
    report = json.loads(robotd(cr3a.domain, "status", "--json")[1])
    assert [axis["servo_on"] for axis in report["axes"]] == [True] * 5 + [False]
    assert robotd(cr3a.domain, "servo", "on", "5")[:2] == (0, "joint6: ok\n")


def test_the_gripper_closes_and_opens(cr3a: RobotProcess, client: Client) -> None:
    joints: list[Any] = client.listen(JointState, "/joint_states")
    assert robotd(cr3a.domain, "gripper", "close")[0] == 0
    client.next(joints, lambda message: message.position[6] > 0.04)
    assert robotd(cr3a.domain, "gripper", "open")[0] == 0
    client.next(joints, lambda message: message.position[6] < 0.001)


def test_without_a_robot_status_says_so() -> None:
    with own_domain() as domain:
        status, output, error = robotd(domain, "status", "--timeout", "0.5")
    assert (status, output) == (5, "")
    assert f"no robot found within 0.5 s, with ROS_DOMAIN_ID={domain} in namespace /" in error
    assert "no service" not in error


def test_a_service_that_the_running_robot_lacks_is_no_missing_robot() -> None:
    with RobotProcess(*NOT_ENABLED) as robot:
        robot.wait_ready()
        status, _, error = robotd(robot.domain, "sim", "pause", "--timeout", "2")
    assert status == 5
    assert "no service /robotd_sim/pause within 2 s: robotd is running, but without it" in error


def test_a_namespace_is_followed_by_the_same_ros_args() -> None:
    remap = ("--ros-args", "-r", "__ns:=/left")
    with RobotProcess(*NOT_ENABLED, *remap) as robot:
        robot.wait_ready()
        status, output, _ = robotd(robot.domain, "status", "--json", *remap)
    assert status == 0
    assert not any(axis["servo_on"] for axis in json.loads(output)["axes"])


def test_of_several_arms_one_must_be_chosen(cr3a: RobotProcess, client: Client) -> None:
    action = "joint_trajectory_action:=/other/follow"
    other = ("--ros-args", "-r", "__ns:=/other", "-p", action)
    with RobotProcess(*other, domain=cr3a.domain) as second:
        second.wait_ready()
        status, _, error = robotd(cr3a.domain, "move", "joint1=0")
    assert status == 1
    assert "several arms: choose one by --action" in error
    assert "/other/follow" in error


def test_robots_of_one_namespace_are_no_choice_of_an_action(
    cr3a: RobotProcess, client: Client
) -> None:
    with RobotProcess(domain=cr3a.domain) as second:
        second.wait_ready()
        status, _, error = robotd(cr3a.domain, "move", "joint1=0")
    assert status == 1
    # Of a robot whose action is not discovered yet the other one knows.
    shared = "2 robots share (the action /movensys_manipulator_arm_controller|this namespace)"
    assert re.search(shared, error)
    assert "a namespace of its own" in error


def test_the_other_joints_of_a_chosen_arm_stay_where_that_arm_has_them(
    cr3a: RobotProcess, client: Client
) -> None:
    first: list[Any] = client.listen(JointState, "/joint_states")
    second: list[Any] = client.listen(JointState, "/other/joint_states")
    remap = ("--ros-args", "-r", "__ns:=/other")
    with RobotProcess(*remap, domain=cr3a.domain) as robot:
        robot.wait_ready()
        start = client.next(second).position
        goal = client.next(first).position[1] + 0.05
        assert robotd(cr3a.domain, "move", f"joint2={goal}", "--action", ACTION)[0] == 0
        assert abs(client.next(first).position[1] - start[1]) > 0.01
        other = ("--action", f"/other{ACTION}")
        status, _, error = robotd(cr3a.domain, "move", f"joint1={start[0] + 0.05}", *other)
        assert status == 0, error
        assert "robot: cr3a in /other, backend sim" in error
        end = client.next(second).position
    assert end[0] == pytest.approx(start[0] + 0.05, abs=1e-3)
    assert end[1:] == pytest.approx(start[1:], abs=1e-3)


def test_the_robot_of_a_chosen_arm_is_asked_whether_it_may_move(
    cr3a: RobotProcess, client: Client
) -> None:
    remap = ("--ros-args", "-r", "__ns:=/other")
    move = ("move", "joint1=0.05", "--action", f"/other{ACTION}")
    with RobotProcess(*remap, domain=cr3a.domain) as robot:
        robot.wait_ready()
        assert client.call(Trigger, "/robotd/stop").success
        status, _, error = robotd(cr3a.domain, *move)
        assert client.call(Trigger, "/robotd/reset").success
        assert status == 0, error
        assert client.call(Trigger, "/other/robotd/stop").success
        status, _, error = robotd(cr3a.domain, *move)
    assert status == 1
    assert "motion is stopped: by a client of the stop service" in error


def test_a_robot_that_dies_in_motion_is_noticed() -> None:
    with RobotProcess() as robot:
        robot.wait_ready()
        move = ("move", "joint1=1.5", "--time", "20", "--timeout", "8")
        with started(robot.domain, *move) as moving:
            with closing(Client(robot.domain)) as client:
                joints: list[Any] = client.listen(JointState, "/joint_states")
                wait_until(lambda: joints and joints[-1].position[0] > 0.01, "motion")
            robot.process.kill()
            _, error = moving.communicate(timeout=90)
    assert moving.returncode == 5
    assert "no feedback from the robot within 8 s" in error
    assert "the arm may be moving, robotd stop stops it" in error


class DeafClient(GoalClient):
    """Action client to which the answer to a goal never comes."""

    def send_goal_async(self, *args: Any, **kwargs: Any) -> Future:
        super().send_goal_async(*args, **kwargs)
        return Future()


class MuteClient(DeafClient):
    """Action client whose goal never arrives."""

    def send_goal_async(self, *args: Any, **kwargs: Any) -> Future:
        return Future()


@pytest.mark.parametrize(
    ("action_client", "says", "moves"),
    [
        (DeafClient, "it was canceled: canceled by the client", True),
        (MuteClient, "the robot has not received it, nothing moved", False),
    ],
)
def test_a_goal_without_an_answer_is_canceled(
    cr3a: RobotProcess,
    client: Client,
    monkeypatch: pytest.MonkeyPatch,
    action_client: type[GoalClient],
    says: str,
    moves: bool,
) -> None:
    monkeypatch.setattr(motion_client, "ActionClient", action_client)
    joints: list[Any] = client.listen(JointState, "/joint_states")
    start = client.next(joints).position[0]
    monkeypatch.setenv("ROS_DOMAIN_ID", str(cr3a.domain))
    asking = RosClient(timeout_s=3.0, searches=True)
    asking.start()
    with closing(asking):
        arm = motion_client.find_arm(asking, ["joint1"])
        with pytest.raises(DeviceTimeout, match="no answer to the goal within 3 s") as caught:
            motion_client.move(
                asking, arm, {"joint1": start + 1.0}, 20.0, lambda: False, lambda *_: None
            )
    assert says in str(caught.value)
    end = client.next(joints)
    assert abs(end.velocity[0]) < 1e-3
    assert (abs(end.position[0] - start) > 0.01) == moves
    assert robotd(cr3a.domain, "move", f"joint1={start}")[0] == 0
