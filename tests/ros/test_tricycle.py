"""tricycle_controller over DDS."""

from __future__ import annotations

import math

import pytest
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray
from tests.ros.robot_process import Client, RobotProcess, command_until
from tf2_msgs.msg import TFMessage

pytestmark = [pytest.mark.daily, pytest.mark.ros]

NODE = "/tricycle_controller"
RADIUS_M, WHEELBASE_M = 0.1, 0.8
LINEAR, ANGULAR = 0.3, 0.2


def test_it_drives_an_arc_and_comes_to_rest() -> None:
    with RobotProcess(robot="tricycle_base", backend="sim") as process:
        process.wait_ready()
        client = Client(process.domain)
        client.wait_engine()
        odometry = client.listen(Odometry, f"{NODE}/odom")
        wheels = client.listen(Float64MultiArray, f"{NODE}/wheel_speeds")
        transforms = client.listen(TFMessage, "/tf", 100)
        publisher = client.publisher(TwistStamped, f"{NODE}/cmd_vel")
        message = TwistStamped()
        message.twist.linear.x, message.twist.angular.z = LINEAR, ANGULAR
        rim = math.hypot(LINEAR, WHEELBASE_M * ANGULAR)

        def has_speed() -> bool:
            if not (odometry and wheels):
                return False
            twist = odometry[-1].twist.twist
            found = (twist.linear.x, twist.angular.z)
            speed = RADIUS_M * wheels[-1].data[0]
            return found == pytest.approx((LINEAR, ANGULAR), abs=2e-3) and speed == pytest.approx(
                rim, abs=5e-3
            )

        # The stamp of the message is zero: it has no age.
        command_until(lambda: publisher.publish(message), has_speed, "the commanded arc")
        client.next(
            odometry, lambda message: abs(message.twist.twist.linear.x) < 1e-6
        )  # the time-out
        last = client.next(odometry)
        assert last.pose.pose.position.x > 0.05
        assert last.pose.covariance[0] > 0.0
        frames = {
            transform.child_frame_id for message in transforms for transform in message.transforms
        }
        assert {"base_footprint", "steering_link", "front_wheel"} <= frames
        client.close()
