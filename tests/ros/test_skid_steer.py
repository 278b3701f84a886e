"""diff_drive_controller of a skid-steer base over DDS."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray
from tests.ros.robot_process import Client, RobotProcess, command_until, connected
from wmx_ros2_message.msg import AxisState

pytestmark = pytest.mark.ros

RADIUS_M, TRACK_M = 0.165, 0.57 * 1.5
LINEAR, ANGULAR = 0.3, 0.4


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    arguments = ["--ros-args", "-p", "left_axes:=[0, 1]", "-p", "publish_tf:=true"]
    with RobotProcess(*arguments, robot="skid_steer_base", backend="sim") as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


def test_it_drives_all_wheels_of_a_side_alike(client: Client) -> None:
    odometry = client.listen(Odometry, "/odom")
    wheels = client.listen(Float64MultiArray, "/velocity_controller/commands")
    axes = client.listen(AxisState, "/wmx/axis/state")
    publisher = client.publisher(Twist, "/cmd_vel")
    message = Twist()
    message.linear.x, message.angular.z = LINEAR, ANGULAR
    turning = ANGULAR * TRACK_M / 2
    speeds = [LINEAR - turning] * 2 + [LINEAR + turning] * 2
    client.next(odometry)
    start = list(client.next(axes).actual_pos)

    def has_speed() -> bool:
        if not wheels:
            return False
        twist = odometry[-1].twist.twist
        rims = [RADIUS_M * speed for speed in wheels[-1].data]
        return (twist.linear.x, twist.angular.z) == pytest.approx(
            (LINEAR, ANGULAR), abs=1e-3
        ) and rims == pytest.approx(speeds, abs=2e-3)

    command_until(lambda: publisher.publish(message), has_speed, "the commanded speed")
    client.next(odometry, lambda message: abs(message.twist.twist.linear.x) < 1e-6)  # the time-out
    turns = [now - before for now, before in zip(client.next(axes).actual_pos, start, strict=True)]
    left, right = RADIUS_M * (turns[0] + turns[1]) / 2, RADIUS_M * (turns[2] + turns[3]) / 2
    pose = client.next(odometry).pose.pose
    heading = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
    assert heading == pytest.approx((right - left) / TRACK_M, abs=1e-3)


def test_axes_that_contradict_the_descriptor_are_rejected() -> None:
    arguments = ["--ros-args", "-p", "right_axes:=[3, 2]"]
    with RobotProcess(*arguments, robot="skid_steer_base", backend="sim") as process:
        assert process.exit_status() == 3
        assert "right_axes: [3, 2] contradicts drive.right_axes: [2, 3]" in process.output
