"""Twists and poses of the tool on the topics of MoveIt Servo, over DDS."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8, String
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_until
from tests.ros.test_operator_tools import RIGHT, has_ended, hold, keyboard_jog, screen_until
from tests.ros.test_trajectory import goal

from robotd.api import FloatArray, load_robot_descriptor
from robotd_ros.problem_messages import read_problems
from robotd_tool_space import Kinematics

pytestmark = pytest.mark.ros

READY = [0.3, -0.6, 1.6, -0.3, 1.2, 0.0]
CONTROLLER = "/movensys_manipulator_arm_controller/follow_joint_trajectory"
ARM = load_robot_descriptor("cr3a")
NODES = f"nodes=[{','.join(ARM.nodes)},servo_node]"
RATE_HZ = 50.0
BASE, TOOL = "base_link", "link6"


class Hand:
    """Client of the topics; ``command`` is published at ``RATE_HZ`` while it is not None."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.command: Any = None
        self.states = client.listen(JointState, "/joint_states")
        self.codes = client.listen(Int8, "/servo_node/status")
        self.reasons = client.listen(String, "/servo_node/status_message")
        self.problems = client.listen(DiagnosticArray, "/robotd/problems", LATCHED)
        self._arm = Kinematics.of_descriptor(ARM, next(iter(ARM.joint_groups)))
        self._publishers = {
            TwistStamped: client.publisher(TwistStamped, "/servo_node/delta_twist_cmds"),
            PoseStamped: client.publisher(PoseStamped, "/servo_node/pose_target_cmds"),
        }
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    @property
    def pose(self) -> FloatArray:
        return self._arm.forward(np.array(self.states[-1].position[:6]))

    @property
    def waiting(self) -> bool:
        """The twists came on while motion was rejected."""
        found = read_problems(self.problems[-1])
        return any("servo_node/delta_twist_cmds kept" in each.reason for each in found)

    def wait_at_rest(self) -> None:
        wait_until(
            lambda: max(abs(value) for value in self.states[-1].velocity[:6]) < 1e-3, "standstill"
        )

    def go_ready(self) -> None:
        _, result = self.client.send_goal(goal((4.0, READY))).result()
        assert result.error_code == FollowJointTrajectory.Result.SUCCESSFUL, result.error_string
        self.wait_at_rest()

    def _run(self) -> None:
        while not self._closing.wait(1.0 / RATE_HZ):
            if (command := self.command) is not None:
                self._publishers[type(command)].publish(command)


def twist(*linear: float, frame: str = BASE) -> TwistStamped:
    message = TwistStamped()
    message.header.frame_id = frame
    message.twist.linear.x, message.twist.linear.y, message.twist.linear.z = linear
    return message


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[RobotProcess, Hand]]:
    with RobotProcess("--set", NODES, backend="sim") as process:
        process.wait_ready()
        for client in connected(process):
            hand = Hand(client)
            try:
                yield process, hand
            finally:
                hand.close()


@pytest.fixture
def hand(served: tuple[RobotProcess, Hand]) -> Iterator[Hand]:
    _, hand = served
    hand.go_ready()
    yield hand
    hand.command = None
    hand.wait_at_rest()


@pytest.mark.parametrize("frame", [BASE, TOOL])
def test_a_twist_moves_the_tool_along_its_axis_while_messages_come(hand: Hand, frame: str) -> None:
    before = hand.pose
    axis = np.array([0.0, 0.0, 1.0]) if frame == BASE else before[:3, 2]
    hand.command = twist(0.0, 0.0, 0.1, frame=frame)
    wait_until(lambda: (hand.pose - before)[:3, 3] @ axis > 0.04, "4 cm")
    assert hand.codes[-1].data == 0
    hand.command = None
    hand.wait_at_rest()
    way = (hand.pose - before)[:3, 3]
    assert np.linalg.norm(way - (way @ axis) * axis) < 1e-4
    assert np.abs(hand.pose[:3, :3] - before[:3, :3]).max() < 1e-3


def test_a_pose_target_is_reached(hand: Hand) -> None:
    before = hand.pose
    message = PoseStamped()
    message.header.frame_id = BASE
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z = (before[:3, 3] + [0.03, -0.04, -0.05]).tolist()
    w = 0.5 * np.sqrt(1.0 + np.trace(before[:3, :3]))
    skew = before[:3, :3] - before[:3, :3].T
    turn.x, turn.y, turn.z = (
        float(each / (4.0 * w)) for each in (skew[2, 1], skew[0, 2], skew[1, 0])
    )
    turn.w = float(w)
    hand.command = message
    target = before[:3, 3] + [0.03, -0.04, -0.05]
    wait_until(lambda: np.abs(hand.pose[:3, 3] - target).max() < 1e-4, "the target")


def test_the_status_names_a_singularity_before_which_the_tool_stops(hand: Hand) -> None:
    out = hand.pose[:3, 3] * [1.0, 1.0, 0.0]
    hand.command = twist(*(0.3 * out / np.linalg.norm(out)).tolist())
    wait_until(lambda: hand.codes[-1].data == 2, "the status")
    wait_until(lambda: "singular" in hand.reasons[-1].data, "its reason")
    hand.wait_at_rest()


def test_wrong_messages_move_nothing_and_are_named(served: tuple[RobotProcess, Hand]) -> None:
    process, hand = served
    hand.go_ready()
    before = hand.pose
    for message, text in (
        (twist(0.0, 0.0, 0.1, frame="camera"), "unknown frame_id 'camera'"),
        (twist(0.0, 0.0, float("nan")), "has a number that is not finite"),
        (PoseStamped(), "has length 0, must be 1"),
    ):
        if isinstance(message, PoseStamped):
            message.pose.orientation.w = 0.0
        hand.command = message
        process.wait_output(text)
    hand.command = None
    assert np.abs(hand.pose - before).max() < 1e-6


def test_after_a_stop_nothing_moves_until_the_source_was_silent(hand: Hand) -> None:
    before = hand.pose
    hand.command = twist(0.0, 0.0, 0.05)
    wait_until(lambda: hand.pose[2, 3] - before[2, 3] > 0.01, "motion")
    assert hand.client.call(Trigger, "/robotd/stop").success
    hand.wait_at_rest()
    assert hand.client.call(Trigger, "/robotd/reset").success
    wait_until(lambda: hand.waiting, "the problem")
    rest = hand.pose
    seen = len(hand.states)
    wait_until(lambda: len(hand.states) > seen + 50, "joint states")
    assert np.abs(hand.pose - rest).max() < 1e-6
    hand.command = None
    wait_until(lambda: not hand.waiting, "no problem")
    hand.command = twist(0.0, 0.0, -0.05)
    wait_until(lambda: hand.pose[2, 3] - rest[2, 3] < -0.005, "motion anew")


def test_the_tool_moves_along_its_axis_while_a_key_is_held(
    served: tuple[RobotProcess, Hand], hand: Hand
) -> None:
    process, _ = served
    before = hand.pose
    axis = before[:3, 2]
    with keyboard_jog(process.domain, "--tool", "tool") as (jog, master):
        screen_until(master, b"hold to move")
        os.write(master, b"3")
        hold(master, RIGHT, lambda: (hand.pose - before)[:3, 3] @ axis > 0.02)
        hand.wait_at_rest()
        way = (hand.pose - before)[:3, 3]
        assert np.linalg.norm(way - (way @ axis) * axis) < 1e-4
        os.write(master, b"q")
        wait_until(lambda: has_ended(jog, master), "it ends")
        assert jog.returncode == 0
