"""A base on the backend mujoco over ROS: its true pose beside its odometry."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from tests.ros.robot_process import Client, RobotProcess, command_until, connected

pytestmark = pytest.mark.ros

SPEED_M_S = 0.3
AGREES_M = 0.1  # of 0.6; wheels that a stall of the computer has stopped slip
TRUTH, ODOMETRY = "/base_pose_ground_truth", "/odom_enc"


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with RobotProcess(robot="baymax", backend="mujoco") as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


def test_the_true_pose_of_a_base_is_a_topic(client: Client) -> None:
    truth, odometry = client.listen(Odometry, TRUTH), client.listen(Odometry, ODOMETRY)
    publisher = client.publisher(Twist, "/cmd_vel")
    message = Twist()
    message.linear.x = SPEED_M_S

    def drives() -> bool:
        if not truth or truth[-1].pose.pose.position.x < 0.3:
            return False
        speed: float = truth[-1].twist.twist.linear.x
        return speed == pytest.approx(SPEED_M_S, abs=0.02)

    ahead = "0.3 m ahead at the commanded speed"
    command_until(lambda: publisher.publish(message), drives, ahead)
    assert (truth[-1].header.frame_id, truth[-1].child_frame_id) == ("world", "base_link")
    client.next(truth, lambda message: abs(message.twist.twist.linear.x) < 1e-3)  # the time-out
    true, told = client.next(truth).pose.pose.position, client.next(odometry).pose.pose.position
    assert math.hypot(true.x - told.x, true.y - told.y) < AGREES_M
    assert true.z == pytest.approx(0.09, abs=0.005)
