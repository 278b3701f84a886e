"""Twists of the tool on the topic of MoveIt Servo, over DDS."""

from __future__ import annotations

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
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_until
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
BASE = "base_link"


class Hand:
    """Client of the topics; ``command`` is published at ``RATE_HZ`` while it is not None."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.command: Any = None
        self.states = client.listen(JointState, "/joint_states")
        self.owners = client.listen_owners()
        self.codes = client.listen(Int8, "/servo_node/status")
        self.reasons = client.listen(String, "/servo_node/status_message")
        self.problems = client.listen(DiagnosticArray, "/robotd/problems", LATCHED)
        self._arm = Kinematics.of_descriptor(ARM, next(iter(ARM.joint_groups)))
        self._publishers = {
            TwistStamped: client.publisher(TwistStamped, "/servo_node/delta_twist_cmds"),
            PoseStamped: client.publisher(PoseStamped, "/servo_node/pose_target_cmds"),
        }
        wait_until(lambda: self.states and self.owners, "joint states and owners")
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
        return any("servo_node/delta_twist_cmds kept" in problem.reason for problem in found)

    @property
    def speed(self) -> float:
        return max(abs(value) for value in self.states[-1].velocity[:6])

    def wait_at_rest(self) -> None:
        """Also until the client that moved it has given it back, shortly after standstill."""
        wait_until(lambda: self.speed < 1e-3 and not self.owners[-1], "rest")

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
    with RobotProcess("--set", NODES, backend="sim", simulated_time=True) as process:
        process.wait_ready()
        with connected(process) as client:
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


def test_a_twist_moves_the_tool_along_its_axis_while_messages_come(hand: Hand) -> None:
    before = hand.pose
    axis = np.array([0.0, 0.0, 1.0])
    hand.command = twist(0.0, 0.0, 0.1)
    wait_until(lambda: (hand.pose - before)[:3, 3] @ axis > 0.04, "4 cm")
    assert hand.codes[-1].data == 0
    hand.command = None
    hand.wait_at_rest()
    displacement = (hand.pose - before)[:3, 3]
    # A stall of this computer takes the joints off the line; the unit tests judge the line itself.
    assert np.linalg.norm(displacement - (displacement @ axis) * axis) < 0.2 * (displacement @ axis)
    assert np.abs(hand.pose[:3, :3] - before[:3, :3]).max() < 5e-2
