"""Two arms on one device: an action and topics for each, one message of joint states."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from tests.ros.robot_process import Client, RobotProcess, command_until, connected, wait_until
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from wmx_ros2_message.msg import AxisVelocity

from robotd.clock import NANOSECONDS

pytestmark = pytest.mark.ros

JOINTS = {side: [f"{side}_joint{number}" for number in range(1, 7)] for side in ("left", "right")}
ACTION = {side: f"/{side}_controller/follow_joint_trajectory" for side in JOINTS}
SUCCEEDED, CANCELED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED


@pytest.fixture(scope="module")
def arms() -> Iterator[RobotProcess]:
    with RobotProcess(robot="dual_cr3a", backend="sim", simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arms: RobotProcess) -> Iterator[Client]:
    with connected(arms) as client:
        yield client


@pytest.fixture
def go(client: Client) -> Callable[..., Any]:
    """Function that sends a goal for all joints of one side: target, seconds, stamp in ns."""

    def send(side: str, target: float, seconds: int, stamp_ns: int = 0) -> Any:
        point = JointTrajectoryPoint(
            positions=[target] * 6, time_from_start=Duration(sec=seconds, nanosec=0)
        )
        goal = FollowJointTrajectory.Goal()
        goal.trajectory = JointTrajectory(joint_names=JOINTS[side], points=[point])
        goal.trajectory.header.stamp.sec = stamp_ns // NANOSECONDS
        goal.trajectory.header.stamp.nanosec = stamp_ns % NANOSECONDS
        return client.send_goal(goal, action=ACTION[side])

    return send


def robotd(domain: int, *arguments: str) -> tuple[int, str]:
    """Exit status and all output of a client command."""
    done = subprocess.run(
        [sys.executable, "-m", "robotd", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
    )
    return done.returncode, done.stdout + done.stderr


def test_there_is_an_action_for_each_group_and_one_topic_of_joint_states(client: Client) -> None:
    states = client.listen(JointState, "/joint_states")
    wait_until(lambda: states, "joint states")
    assert list(states[0].name) == [*JOINTS["left"], *JOINTS["right"]]
    assert client.node.count_publishers("/joint_states") == 1
    node = "follow_joint_trajectory_server"
    wait_until(lambda: len(client.actions_of(node)) == len(ACTION), "the actions")
    assert set(client.actions_of(node)) == set(ACTION.values())


def test_goals_with_one_stamp_move_both_arms_together(client: Client, go: Any) -> None:
    states = client.listen(JointState, "/joint_states")
    stamp_ns = client.now_ns + 2 * NANOSECONDS
    goals = [go(side, 0.4, 2, stamp_ns) for side in JOINTS]
    for goal in goals:
        status, result = goal.result()
        assert status == SUCCEEDED, result.error_string
    apart = [abs(message.position[0] - message.position[6]) for message in states]
    assert states[-1].position[6] == pytest.approx(0.4, abs=0.01)
    assert max(apart) < 0.05  # they move 0.4 rad


def test_cancelling_one_arm_leaves_the_other_moving(client: Client, go: Any) -> None:
    states = client.listen(JointState, "/joint_states")
    left, right = go("left", -0.6, 20), go("right", 0.0, 3)
    wait_until(lambda: states and states[-1].velocity[0] < -0.005, "motion of the left arm")
    left.cancel()
    assert left.result()[0] == CANCELED
    status, result = right.result()
    assert status == SUCCEEDED, result.error_string


def test_a_topic_moves_one_arm_while_a_goal_moves_the_other(client: Client, go: Any) -> None:
    states = client.listen(JointState, "/joint_states")
    owners = client.listen_owners()
    topic = "left_position_controller/commands"
    publisher = client.publisher(Float64MultiArray, f"/{topic}")
    wait_until(lambda: states, "joint states")
    target = states[-1].position[0] + 0.1
    right = go("right", 0.3, 3)

    command_until(
        lambda: publisher.publish(Float64MultiArray(data=[target] * 6)),
        lambda: abs(states[-1].position[0] - target) < 0.01,
        "the streamed motion",
    )
    status, result = right.result()
    assert status == SUCCEEDED, result.error_string
    both = {"left_joint1": topic, "right_joint1": "trajectory"}
    assert any(both.items() <= found.items() for found in owners)


def test_move_finds_the_group_by_its_joints(arms: RobotProcess, client: Client) -> None:
    states = client.listen(JointState, "/joint_states")
    status, output = robotd(arms.domain, "move", "right_joint2=-0.2", "--time", "1")
    assert status == 0, output
    wait_until(lambda: states and abs(states[-1].position[7] + 0.2) < 0.01, "the target")
    status, output = robotd(arms.domain, "move", "left_joint1=0.1", "right_joint1=0.1")
    assert status == 1
    assert "one joint group moves at a time" in output


@pytest.mark.daily
def test_one_jog_moves_axes_of_both_arms(client: Client) -> None:
    states = client.listen(JointState, "/joint_states")
    publisher = client.publisher(AxisVelocity, "/wmx/axis/jog")
    message = AxisVelocity(index=[5, 11], velocity=[0.3, -0.3], acc=[5.0] * 2, dec=[5.0] * 2)
    wait_until(lambda: states, "joint states")
    begin = states[-1].position

    def are_moved() -> bool:
        ends = states[-1].position
        return bool(ends[5] > begin[5] + 0.1 and ends[11] < begin[11] - 0.1)

    command_until(lambda: publisher.publish(message), are_moved, "motion of both axes")
    wait_until(lambda: max(map(abs, states[-1].velocity)) < 1e-3, "standstill")
