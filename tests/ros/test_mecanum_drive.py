"""mecanum_drive_controller and robot_state_publisher over DDS, on one robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray, String
from tests.ros.robot_process import (
    LATCHED,
    Client,
    RobotProcess,
    command_until,
    connected,
    stamp_s,
    wait_until,
)
from tf2_msgs.msg import TFMessage

pytestmark = [pytest.mark.daily, pytest.mark.ros]

NODE = "/mecanum_drive_controller"
PREFIX = "left/"
RADIUS_M, LEVER_M = 0.076, 0.41
WHEELS = [f"{PREFIX}{place}_wheel" for place in ("front_left", "front_right", "rear_left",
                                                 "rear_right")]  # fmt: skip
COMMAND = (0.2, -0.3, 0.4)  # x, y in m/s, yaw in rad/s


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    arguments = ["--ros-args", "-p", f"frame_prefix:={PREFIX}"]
    with RobotProcess(*arguments, robot="mecanum_base", backend="sim") as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


def by_child(message: TFMessage) -> dict[str, Any]:
    return {transform.child_frame_id: transform for transform in message.transforms}


def test_it_moves_in_every_direction_at_once(client: Client) -> None:
    odometry = client.listen(Odometry, f"{NODE}/odometry")
    transforms = client.listen(TFMessage, f"{NODE}/tf_odometry", 100)
    wheels = client.listen(Float64MultiArray, f"{NODE}/wheel_speeds")
    publisher = client.publisher(TwistStamped, f"{NODE}/reference")
    message = TwistStamped()
    message.twist.linear.x, message.twist.linear.y, message.twist.angular.z = COMMAND
    x, y, turning = *COMMAND[:2], COMMAND[2] * LEVER_M
    speeds = [x - y - turning, x + y + turning, x + y - turning, x - y + turning]

    def has_speed() -> bool:
        if not (odometry and wheels):
            return False
        twist = odometry[-1].twist.twist
        found = (twist.linear.x, twist.linear.y, twist.angular.z)
        rims = [RADIUS_M * speed for speed in wheels[-1].data]
        return found == pytest.approx(COMMAND, abs=1e-3) and rims == pytest.approx(speeds, abs=2e-3)

    # The stamp of the message is zero: it has no age.
    command_until(lambda: publisher.publish(message), has_speed, "the commanded speed")
    client.next(odometry, lambda message: abs(message.twist.twist.linear.x) < 1e-6)  # the time-out
    pose = client.next(odometry).pose.pose
    assert math.hypot(pose.position.x, pose.position.y) > 0.05
    last = client.next(transforms).transforms[0]
    assert (last.header.frame_id, last.child_frame_id) == ("left/odom", "left/base_footprint")
    assert last.transform.translation.y == pytest.approx(pose.position.y, abs=1e-6)
    turned = by_child(client.next(client.listen(TFMessage, "/tf", 100)))
    assert any(abs(turned[name].transform.rotation.y) > 0.01 for name in WHEELS)


def test_wheels_turn_in_their_frames(client: Client) -> None:
    wheels = by_child(client.next(client.listen(TFMessage, "/tf", 100)))
    assert sorted(wheels) == sorted(WHEELS)
    for name in WHEELS:
        wheel = wheels[name]
        assert wheel.header.frame_id == "left/base_link"
        assert stamp_s(wheel) > 1e9
        side = 0.19 if name.endswith("left_wheel") else -0.19
        assert wheel.transform.translation.y == pytest.approx(side)
        turn = wheel.transform.rotation
        assert turn.y**2 + turn.w**2 == pytest.approx(1.0)


def test_fixed_frames_and_the_urdf_are_latched(client: Client) -> None:
    static = client.listen(TFMessage, "/tf_static", LATCHED)
    description = client.listen(String, "/robot_description", LATCHED)
    frames = by_child(wait_until(lambda: static and static[0], "fixed frames"))
    assert sorted(frames) == ["left/base_link", "left/lidar"]
    assert frames["left/lidar"].header.frame_id == "left/base_link"
    lidar = frames["left/lidar"].transform
    assert (lidar.translation.x, lidar.translation.z) == pytest.approx((0.2, 0.16))
    assert abs(lidar.rotation.z) == pytest.approx(1.0)
    text = wait_until(lambda: description and description[0].data, "the URDF")
    assert '<robot name="mecanum_base">' in text
