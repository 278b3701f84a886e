"""The mobile base on CANopen drives in velocity mode, in another process, by ROS."""

from __future__ import annotations

from pathlib import Path

import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from tests.plugins.canopen.bus.drives_process import DrivesProcess, write_robot
from tests.ros.robot_process import Client, RobotProcess, command_until, wait_until
from wmx_ros2_message.msg import AxisState

pytestmark = pytest.mark.ros

PERIOD_S = 0.05
RADIUS_M, SEPARATION_M = 0.09, 0.55


def turned(before: AxisState, after: AxisState) -> list[float]:
    """Angle of each wheel from one state to another, rad."""
    return [after.actual_pos[wheel] - before.actual_pos[wheel] for wheel in (0, 1)]


def test_it_drives_tells_where_it_is_and_stops_without_commands(tmp_path: Path) -> None:
    path = write_robot(tmp_path, "baymax")
    with DrivesProcess("baymax"), RobotProcess(robot=str(path), backend="canopen") as base:
        base.wait_ready()
        client = Client(base.domain)
        try:
            client.wait_engine()
            odometry = client.listen(Odometry, "/odom_enc")
            axes = client.listen(AxisState, "/wmx/axis/state")
            publisher = client.publisher(Twist, "/cmd_vel")
            first, _ = client.next(axes), client.next(odometry)
            twist = Twist()
            twist.linear.x, twist.angular.z = 0.4, 0.5

            def has_speed() -> bool:
                moving = odometry[-1].twist.twist
                has_moved = RADIUS_M * sum(turned(first, axes[-1])) / 2 > 0.4
                return has_moved and (moving.linear.x, moving.angular.z) == pytest.approx(
                    (0.4, 0.5), abs=0.02
                )

            condition = "the speed of the command, over 0.4 m"
            command_until(lambda: publisher.publish(twist), has_speed, condition)
            start = client.next(axes)
            base.wait_output("no command in time")
            wait_until(lambda: abs(odometry[-1].twist.twist.linear.x) < 1e-3, "standstill")
            last, pose = client.next(axes), client.next(odometry).pose.pose
            left, right = turned(first, last)
            heading = RADIUS_M * (right - left) / SEPARATION_M
            assert min(turned(start, last)) > 0, "it comes to rest by a ramp"
            assert 2 * pose.orientation.z == pytest.approx(heading, rel=0.1)
            assert list(last.servo_on) == [True, True]
        finally:
            client.close()
        assert base.end() == 0, base.output
