"""use_sim_time: stamps follow /clock, motion follows the computer's clock."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from tests.ros.robot_process import Client, RobotProcess, wait_until
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.msg import AxisState

pytestmark = [pytest.mark.daily, pytest.mark.ros]

SIM_TIME = ("--ros-args", "-p", "use_sim_time:=true")


@pytest.fixture
def start() -> Iterator[Any]:
    """Starts a robot on simulated time, with a client and a publisher of /clock."""
    opened: list[Any] = []

    def start(robot: str, *parameters: str) -> tuple[Client, Any]:
        more = [word for parameter in parameters for word in ("-p", parameter)]
        process = RobotProcess(*SIM_TIME, *more, robot=robot)
        opened.append(process.__exit__)
        process.wait_ready()
        client = Client(process.domain)
        opened.append(client.close)
        return client, client.publisher(Clock, "/clock")

    yield start
    for close in reversed(opened):
        close()


def tell(clock: Any, sec: int, nanosec: int) -> None:
    message = Clock()
    message.clock.sec, message.clock.nanosec = sec, nanosec
    clock.publish(message)


def stamp(message: Any) -> tuple[int, int]:
    first = message.transforms[0] if isinstance(message, TFMessage) else message
    return first.header.stamp.sec, first.header.stamp.nanosec


def test_stamps_of_the_base_follow_the_clock_forth_and_back(start: Any) -> None:
    client, clock = start("baymax", "publish_tf:=true")
    topics = [
        client.listen(Odometry, "/odom_enc"),
        client.listen(TFMessage, "/tf"),
        client.listen(AxisState, "/wmx/axis/state"),
    ]
    for messages in topics:
        assert stamp(client.next(messages)) == (0, 0), "before the first message of /clock"
    for time in ((1234, 500_000_000), (1234, 500_000_001), (7, 0)):
        tell(clock, *time)
        for messages in topics:
            client.next(messages, lambda message, time=time: stamp(message) == time)


@pytest.mark.long
def test_a_goal_is_carried_out_while_the_simulated_time_stands_still(start: Any) -> None:
    client, clock = start("cr3a")
    joints = client.listen(JointState, "/joint_states")
    tell(clock, 1234, 0)
    client.next(joints, lambda message: stamp(message) == (1234, 0))
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = [f"joint{number}" for number in range(1, 7)]
    goal.trajectory.header.stamp.sec = 1234
    point = JointTrajectoryPoint(positions=[0.02] * 6)  # slow: a stall leads it not far off
    point.time_from_start.sec = 1
    goal.trajectory.points = [point]
    feedback: list[Any] = []
    _, result = client.send_goal(goal, feedback).result()
    assert result.error_code == FollowJointTrajectory.Result.SUCCESSFUL, result.error_string
    assert {stamp(message) for message in feedback} == {(1234, 0)}
    wait_until(lambda: joints[-1].position[0] == pytest.approx(0.02, abs=1e-3), "the goal")
