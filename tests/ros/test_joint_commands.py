"""Motion on topics that a client decides while the arm moves."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from builtin_interfaces.msg import Duration, Time
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointJog, JointTrajectoryControllerState
from control_msgs.srv import QueryTrajectoryState
from rclpy.duration import Duration as RosDuration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from tests.ros.robot_process import Client, RobotProcess, command_until, wait_until
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from wmx_ros2_message.msg import AxisVelocity
from wmx_ros2_message.srv import SetAxis

pytestmark = pytest.mark.ros

NAMES = [f"joint{number}" for number in range(1, 7)]
CONTROLLER = "/movensys_manipulator_arm_controller"
TRAJECTORY = f"{CONTROLLER}/joint_trajectory"
POSITION = "/forward_position_controller/commands"
VELOCITY = "/forward_velocity_controller/commands"
JOG = "/servo_node/delta_joint_cmds"
RATE_HZ = 50.0


class Arm:
    """Client of the arm's topics."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.states = client.listen(JointState, "/joint_states")
        self.owners = client.listen_owners()
        self.trajectory = client.publisher(JointTrajectory, TRAJECTORY)
        self.positions = client.publisher(Float64MultiArray, POSITION)
        self.velocities = client.publisher(Float64MultiArray, VELOCITY)
        self.jog = client.publisher(JointJog, JOG)

    @property
    def position(self) -> list[float]:
        return list(self.states[-1].position[:6])

    @property
    def speed(self) -> float:
        return max(abs(value) for value in self.states[-1].velocity[:6])

    def publish_until(self, publish: Callable[[], None], condition: Callable[[], Any]) -> None:
        """Publish at ``RATE_HZ`` until the condition holds."""
        command_until(publish, condition, "the streamed motion", RATE_HZ)

    def wait_at_rest(self) -> None:
        """Also until the client that moved it has given it back, shortly after standstill."""
        wait_until(lambda: self.speed < 1e-3 and not self.owners[-1], "rest")

    def go(self, position: list[float]) -> tuple[int, Any]:
        goal = FollowJointTrajectory.Goal()
        goal.trajectory = trajectory((1.5, position))
        return self.client.send_goal(goal).result()

    def wait_at_zero(self) -> None:
        """Go there; a stream may just be ending."""
        wait_until(lambda: self.go([0.0] * 6)[1].error_code == 0, "the arm at zero")


def trajectory(*points: tuple[float, list[float]], names: list[str] | None = None) -> Any:
    return JointTrajectory(
        joint_names=NAMES if names is None else names,
        points=[
            JointTrajectoryPoint(
                positions=positions,
                time_from_start=Duration(sec=int(seconds), nanosec=round(seconds % 1 * 1e9)),
            )
            for seconds, positions in points
        ],
    )


@pytest.fixture(scope="module")
def joints(client: Client) -> Arm:
    """The shared arm, from wherever other tests have left it to zero."""
    joints = Arm(client)
    wait_until(lambda: joints.states and joints.owners, "joint states and owners")
    joints.wait_at_zero()
    return joints


@pytest.fixture
def arm(joints: Arm) -> Iterator[Arm]:
    yield joints
    joints.wait_at_rest()
    joints.wait_at_zero()


@pytest.mark.daily
def test_a_trajectory_on_the_topic_is_executed_and_a_new_one_replaces_it(arm: Arm) -> None:
    arm.trajectory.publish(trajectory((4.0, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])))
    wait_until(lambda: arm.position[0] > 0.1, "motion")
    arm.trajectory.publish(trajectory((1.5, [0.2, 0.1, 0.0, 0.0, 0.0, 0.0])))
    wait_until(
        lambda: arm.position == pytest.approx([0.2, 0.1, 0.0, 0.0, 0.0, 0.0], abs=2e-3), "arrival"
    )


def test_an_empty_trajectory_stops_the_arm(arm: Arm) -> None:
    arm.trajectory.publish(trajectory((5.0, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])))
    wait_until(lambda: arm.position[0] > 0.05, "motion")
    arm.trajectory.publish(JointTrajectory())
    arm.wait_at_rest()
    assert arm.position[0] < 0.8


LONG = [
    (0.004 * number, [0.5 - 0.5 * math.cos(math.pi * number / 1000)] * 6)
    for number in range(1, 1001)
]


def test_a_short_trajectory_after_a_long_one_wins(arm: Arm) -> None:
    arm.trajectory.publish(trajectory(*LONG))  # planned for longer than the next one
    arm.trajectory.publish(trajectory((0.5, [0.01] * 6)))
    wait_until(lambda: arm.position[0] > 5e-3, "motion")
    arm.wait_at_rest()
    assert arm.position == pytest.approx([0.01] * 6, abs=2e-3)


def test_an_empty_trajectory_stops_one_that_is_still_being_planned(
    arm: Arm, cr3a: RobotProcess
) -> None:
    printed = len(cr3a.output)
    arm.trajectory.publish(trajectory(*LONG))
    arm.trajectory.publish(JointTrajectory())
    # It comes before the end of planning, or shortly after it.
    ends = "stopped before it could begin", "canceled by the client"
    wait_until(lambda: any(ending in cr3a.output[printed:] for ending in ends), "its end")
    arm.wait_at_rest()
    assert max(map(abs, arm.position)) < 0.9  # of 1.0; it may have begun where planning was quick


@pytest.mark.daily
def test_single_points_as_moveit_servo_sends_them_are_streamed(arm: Arm) -> None:
    began_s = time.monotonic()

    def publish() -> None:
        angle = min(0.3 * (time.monotonic() - began_s), 0.3)
        arm.trajectory.publish(trajectory((0.034, [angle, 0.0]), names=["joint2", "joint5"]))

    arm.publish_until(publish, lambda: arm.position[1] == pytest.approx(0.3, abs=2e-3))
    assert arm.position[4] == pytest.approx(0.0, abs=2e-3)


def test_positions_are_streamed_and_the_arm_stops_when_they_stop(arm: Arm) -> None:
    target = Float64MultiArray(data=[3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    arm.publish_until(lambda: arm.positions.publish(target), lambda: arm.position[0] > 0.1)
    arm.wait_at_rest()
    assert arm.position[0] < 2.5


def test_velocities_are_streamed_and_the_arm_stops_when_they_stop(arm: Arm) -> None:
    message = Float64MultiArray(data=[0.0, 0.0, 0.2, 0.0, 0.0, -0.2])
    arm.publish_until(lambda: arm.velocities.publish(message), lambda: arm.position[2] > 0.1)
    arm.wait_at_rest()
    assert arm.position[5] == pytest.approx(-arm.position[2], abs=5e-3)


def test_named_joints_are_jogged_while_messages_come(arm: Arm) -> None:
    message = JointJog(joint_names=["joint4"], velocities=[-0.2])
    arm.publish_until(lambda: arm.jog.publish(message), lambda: arm.position[3] < -0.1)
    arm.wait_at_rest()
    assert max(map(abs, (*arm.position[:3], *arm.position[4:]))) < 2e-3


def test_wrong_commands_are_logged_with_the_reason(arm: Arm, cr3a: RobotProcess) -> None:
    streamed, whole, over = (trajectory((deviation, [0.0] * 6)) for deviation in (0.03, 1.0, 1.0))
    streamed.points[0].effort = whole.points[0].effort = [0.0] * 6
    over.header.stamp.sec = 1
    for publisher, message, reason in (
        (arm.positions, Float64MultiArray(data=[0.0] * 5), "position: 5 values for 6 joints"),
        (arm.velocities, Float64MultiArray(data=[math.nan] * 6), "joint1: velocity is nan"),
        (arm.trajectory, streamed, "effort in the point is not supported"),
        (arm.trajectory, whole, "effort in the points is not supported"),
        (arm.trajectory, over, "it is over"),
        (arm.jog, JointJog(joint_names=["elbow"], velocities=[0.1]), "elbow"),
        (arm.jog, JointJog(joint_names=["joint1"], displacements=[0.1]), "displacements"),
    ):
        arm.publish_until(
            lambda publisher=publisher, message=message: publisher.publish(message),
            lambda reason=reason: reason in cr3a.output,
        )


@pytest.mark.parametrize("topic", ["points", "jog"])
def test_commands_of_another_time_are_dropped_and_named(
    arm: Arm, cr3a: RobotProcess, topic: str
) -> None:
    """Neither one that is stamped 10 s ago nor one that is stamped 10 s ahead moves anything."""
    if topic == "jog":
        publisher, message = arm.jog, JointJog(joint_names=["joint1"], velocities=[0.2])
    else:
        publisher, message = arm.trajectory, trajectory((0.03, [0.3, *[0.0] * 5]))
    wait_until(lambda: arm.client.now_ns > 10.5e9, "a time of 10 s ago")
    began, printed = len(arm.states), len(cr3a.output)
    for seconds, text in ((-10.0, "s older than th"), (10.0, "s ahead of th")):

        def publish(seconds: float = seconds) -> None:
            now = arm.client.node.get_clock().now()
            message.header.stamp = (now + RosDuration(seconds=seconds)).to_msg()
            publisher.publish(message)

        arm.publish_until(publish, lambda text=text: text in cr3a.output[printed:])
    arm.publish_until(publish, lambda: len(arm.states) > began + 100)
    assert max(abs(state.position[0]) for state in arm.states[began:]) < 1e-3
    message.header.stamp = Time()  # zero: now
    arm.publish_until(lambda: publisher.publish(message), lambda: arm.position[0] > 0.1)
    arm.wait_at_rest()
    line = re.search(r"commands are in time again.*dropped=(\d+)", cr3a.output[printed:])
    assert line
    assert int(line[1]) > 2


def test_a_best_effort_publisher_streams_as_well_as_a_reliable_one(arm: Arm) -> None:
    quality = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = arm.client.node.create_publisher(Float64MultiArray, POSITION, quality)
    target = Float64MultiArray(data=[0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    arm.publish_until(lambda: publisher.publish(target), lambda: arm.position[0] > 0.1)
    arm.client.node.destroy_publisher(publisher)


def test_a_goal_is_rejected_with_the_owner_while_a_topic_moves_the_arm(arm: Arm) -> None:
    message = JointJog(joint_names=["joint1"], velocities=[0.05])
    arm.publish_until(lambda: arm.jog.publish(message), lambda: arm.position[0] > 0.01)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory = trajectory((1.5, [0.0] * 6))
    sent = arm.client.send_goal(goal)
    arm.publish_until(lambda: arm.jog.publish(message), lambda: sent.done)
    assert "joint1: in use by servo_node/delta_joint_cmds" in sent.result()[1].error_string


def test_the_owner_of_each_joint_is_latched(arm: Arm) -> None:
    arm.wait_at_rest()
    message = JointJog(joint_names=["joint1"], velocities=[0.05])
    arm.publish_until(
        lambda: arm.jog.publish(message),
        lambda: arm.owners[-1].get("joint1") == "servo_node/delta_joint_cmds",
    )
    wait_until(lambda: not arm.owners[-1], "no owner after the last message")


@pytest.mark.daily
def test_axes_are_jogged_while_messages_come_and_stopped_by_the_service(arm: Arm) -> None:
    jog = arm.client.publisher(AxisVelocity, "/wmx/axis/jog")
    message = AxisVelocity(index=[1, 3], velocity=[0.2, -0.2], acc=[5.0] * 2, dec=[5.0] * 2)
    arm.publish_until(lambda: jog.publish(message), lambda: arm.position[1] > 0.1)
    arm.wait_at_rest()
    assert arm.position[3] == pytest.approx(-arm.position[1], abs=5e-3)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory = trajectory((10.0, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    sent = arm.client.send_goal(goal)
    wait_until(lambda: arm.position[0] > 0.02, "motion")
    response = arm.client.call(SetAxis, "/wmx/axis/stop", index=[0], data=[0])
    assert (response.success, response.message) == (True, "joint1: ok")
    assert "joint1" in sent.result()[1].error_string
    arm.wait_at_rest()
    assert not arm.client.call(SetAxis, "/wmx/axis/stop", index=[9], data=[0]).success


def test_the_state_and_the_running_trajectory_can_be_asked_for(arm: Arm) -> None:
    states = arm.client.listen(JointTrajectoryControllerState, f"{CONTROLLER}/controller_state")
    arm.trajectory.publish(trajectory((2.0, [0.4, 0.0, 0.0, 0.0, 0.0, 0.0])))
    state = arm.client.next(states, lambda message: message.reference.velocities[0] > 0.1)
    assert list(state.joint_names) == NAMES
    assert state.reference.positions[0] == pytest.approx(state.feedback.positions[0], abs=0.05)
    assert state.error.positions[0] == pytest.approx(
        state.reference.positions[0] - state.feedback.positions[0]
    )
    running = arm.client.call(QueryTrajectoryState, f"{CONTROLLER}/query_state")
    assert running.success
    assert running.position[0] > state.reference.positions[0]
    assert state.speed_scaling_factor == 1.0
    speed = arm.client.publisher(Float64, "/robotd/set_speed")
    speed.publish(Float64(data=0.5))
    arm.client.next(states, lambda message: message.speed_scaling_factor == 0.5)
    speed.publish(Float64(data=1.0))
    arm.client.next(states, lambda message: message.speed_scaling_factor == 1.0)
    wait_until(lambda: arm.position[0] == pytest.approx(0.4, abs=2e-3), "arrival")
    arm.wait_at_rest()
    held = arm.client.call(QueryTrajectoryState, f"{CONTROLLER}/query_state")
    assert list(held.position) == pytest.approx([0.4, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-3)
    assert list(held.velocity) == [0.0] * 6
