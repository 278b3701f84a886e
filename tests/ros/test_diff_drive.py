"""diff_drive_controller over DDS: names, a square, the watchdog, and what it refuses."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters
from rclpy.duration import Duration
from std_msgs.msg import Float64MultiArray
from tests.ros.driven_base import (
    RADIUS_M,
    SEPARATION_M,
    Base,
    along,
    wheels_say,
)
from tests.ros.robot_process import (
    Client,
    RobotProcess,
    command_until,
    connected,
    names_of,
    stamp_s,
    wait_until,
)
from tf2_msgs.msg import TFMessage
from wmx_ros2_message.srv import SetAxis

pytestmark = [pytest.mark.ros, pytest.mark.second_backend]

TIMEOUT_S, BRAKING_S = 0.5, 0.4
FAST = ["publish_tf:=true", "publish_limited_velocity:=true", f"dec_time:={BRAKING_S}",
        "acc_time:=0.4", "linear.x.max_jerk:=0.0", "angular.z.max_jerk:=0.0"]  # fmt: skip
SLACK_S, MARGIN_S = 0.1, 1.0  # for a busy computer

SENDER = """
import sys, time
import rclpy
from geometry_msgs.msg import Twist
rclpy.init()
publisher = rclpy.create_node("sender").create_publisher(Twist, "/cmd_vel", 1)
twist = Twist()
twist.linear.x, twist.angular.z = float(sys.argv[1]), float(sys.argv[2])
begin_s = time.monotonic()
while True:
    twist.linear.z = time.monotonic()  # comes back in the echo
    if (twist.linear.z - begin_s) % 6.0 < 5.0:  # as command_until: pauses rearm it after a stall
        publisher.publish(twist)
    time.sleep(0.02)
"""


def ros_args(*parameters: str) -> list[str]:
    return ["--ros-args", *(word for parameter in parameters for word in ("-p", parameter))]


@pytest.fixture(scope="module")
def process() -> Iterator[RobotProcess]:
    with RobotProcess(*ros_args(*FAST), robot="baymax") as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(process: RobotProcess) -> Iterator[Client]:
    with connected(process) as client:
        yield client


@pytest.fixture(scope="module")
def base(client: Client) -> Base:
    return Base(client)


def test_names_and_types(client: Client, base: Base) -> None:
    expected = {
        "/cmd_vel": "geometry_msgs/msg/Twist",
        "/cmd_vel_check": "geometry_msgs/msg/Twist",
        "/velocity_controller/commands": "std_msgs/msg/Float64MultiArray",
        "/odom_enc": "nav_msgs/msg/Odometry",
        "/diff_drive_controller/cmd_vel_out": "geometry_msgs/msg/TwistStamped",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/wmx/axis/state": "wmx_ros2_message/msg/AxisState",
    }

    def found() -> bool:
        return expected.items() <= names_of(client.node.get_topic_names_and_types()).items()

    wait_until(found, "the topics")
    nodes = {"wmx_engine_node", "wmx_core_motion_node", "wmx_io_node", "wmx_ethercat_node",
             "diff_drive_controller"}  # fmt: skip
    # The names of nodes come by a topic of their own, later than the topics.
    wait_until(lambda: nodes <= set(client.node.get_node_names()), "the names of all nodes")


def test_the_parameters_of_the_reference(client: Client) -> None:
    names = ["left_axis", "right_axis", "rate", "wheel_radius", "wheel_to_wheel", "cmd_vel_timeout",
             "use_stamped_vel", "odom_frame_id", "base_frame_id"]  # fmt: skip
    answer = client.call(GetParameters, "/diff_drive_controller/get_parameters", names=names)
    left, right, rate, radius, track, timeout, stamped, odom, child = answer.values
    assert (left.integer_value, right.integer_value, rate.integer_value) == (0, 1, 100)
    assert (radius.double_value, track.double_value) == (RADIUS_M, SEPARATION_M)
    assert (timeout.double_value, stamped.bool_value) == (TIMEOUT_S, False)
    assert (odom.string_value, child.string_value) == ("odom", "base_link")


def test_a_square_of_ten_metres(base: Base) -> None:
    base.reset()
    start = len(base.axes) - 1
    for _ in range(4):
        for linear, angular, seconds in ((1.0, 0.0, 2.5), (0.0, math.pi / 2, 1.0)):
            leg = base.drive_and_rest(linear, angular, seconds)
            _, _, heading, distance = along(wheels_say(leg.states))
            speed, driven = (angular, heading) if angular else (linear, distance)
            took_s = driven / speed  # ramps up and down cancel out
            # What comes too late at the wheels ends by the time-out of the command.
            assert leg.least_s - SLACK_S < took_s < leg.most_s + leg.stood_s + TIMEOUT_S + SLACK_S
            assert distance < 0.01 or not angular, "it turned on the spot"
            assert abs(heading) < 0.01 or not linear, "it drove straight on"
    x, y, heading, _ = along(wheels_say(base.axes[start:]))
    assert math.hypot(base.pose[0] - x, base.pose[1] - y) < 1e-3
    off = math.remainder(base.pose[2] - heading, 2 * math.pi)
    assert abs(off) < math.radians(0.1)


@pytest.mark.daily
def test_a_killed_client_stops_the_base_in_time(process: RobotProcess, base: Base) -> None:
    base.rest()
    environment = os.environ | {"ROS_DOMAIN_ID": str(process.domain)}
    with subprocess.Popen([sys.executable, "-c", SENDER, "0.8", "0.4"], env=environment) as sender:
        try:
            wait_until(lambda: base.speed > 0.799, "full speed")
        finally:
            told = process.output.count("no command in time")  # by stalls, too
            killed_s = time.time()  # the clock of the stamps
            sender.kill()
    wait_until(lambda: base.speed < 1e-9, "standstill")
    now_s = time.monotonic()
    earliest_s = TIMEOUT_S + 0.8 * BRAKING_S  # from 0.8 m/s; it brakes from 1 m/s in BRAKING_S
    assert now_s - base.echo[-1].linear.z > earliest_s - 0.05, "since the last command"
    at_rest_s = next(
        stamp_s(message)
        for message in base.odometry
        if message.twist.twist.linear.x < 1e-9 and stamp_s(message) > killed_s
    )
    assert at_rest_s - killed_s < TIMEOUT_S + BRAKING_S + MARGIN_S
    wait_until(lambda: process.output.count("no command in time") > told, "a line of log")
    since = [message.twist.twist for message in base.odometry if stamp_s(message) > killed_s]
    braking = [twist for twist in since if twist.linear.x > 0.1]
    assert len(braking) > 10
    for twist in braking:
        assert twist.angular.z == pytest.approx(twist.linear.x / 2, abs=1e-3)


@pytest.mark.daily
def test_wheel_speeds_and_echo(client: Client, base: Base) -> None:
    omega = client.listen(Float64MultiArray, "/velocity_controller/commands")
    base.drive(0.5, 1.0, 1.0)
    left, right = omega[-1].data
    assert left == pytest.approx((2 * 0.5 - 1.0 * SEPARATION_M) / (2 * RADIUS_M), rel=1e-3)
    assert right == pytest.approx((2 * 0.5 + 1.0 * SEPARATION_M) / (2 * RADIUS_M), rel=1e-3)
    assert (base.echo[-1].linear.x, base.echo[-1].angular.z) == (0.5, 1.0)
    base.rest()


def test_the_limited_command_is_published(client: Client, base: Base) -> None:
    limited = client.listen(TwistStamped, "/diff_drive_controller/cmd_vel_out")
    base.drive(5.0, 2.5, 1.0)
    fastest = max(limited, key=lambda message: message.twist.linear.x)
    assert fastest.header.frame_id == "base_link"
    assert fastest.header.stamp.sec > 1_000_000_000
    highest = 12.0 * RADIUS_M / (1.0 + SEPARATION_M / 4)  # 12 rad/s of the right wheel
    assert 0.1 < fastest.twist.linear.x < highest + 1e-9
    assert fastest.twist.angular.z == pytest.approx(fastest.twist.linear.x / 2)
    base.rest()
    client.next(limited, lambda message: message.twist.linear.x == 0.0)


def test_odometry_and_transform_agree(client: Client, base: Base) -> None:
    transforms = client.listen(TFMessage, "/tf", 100)
    base.reset()
    assert base.pose == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    base.drive(0.3, 0.5, 0.5)
    base.rest()
    (transform,) = client.next(transforms).transforms
    odometry = client.next(base.odometry)
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert transform.transform.translation.x == odometry.pose.pose.position.x > 0.05
    assert transform.transform.translation.y == odometry.pose.pose.position.y > 0.0
    assert transform.transform.rotation == odometry.pose.pose.orientation
    assert odometry.header.stamp.sec > 1_000_000_000
    diagonal = [odometry.pose.covariance[7 * index] for index in range(6)]
    assert diagonal == [1e-3, 1e-3, 1e6, 1e6, 1e6, 1e-2]
    assert sum(odometry.pose.covariance) == pytest.approx(sum(diagonal))


def test_a_command_that_is_not_finite_is_rejected_once(process: RobotProcess, base: Base) -> None:
    base.rest()
    for _ in range(5):
        base.command(math.nan, 0.0)
        base.command(0.0, math.inf)
    wait_until(lambda: "is not finite" in process.output, "a line of log")
    base.drive(0.0, 0.0, 0.2)
    assert process.output.count("is not finite") <= 2
    assert abs(base.speed) < 1e-9


def test_without_a_servo_it_stands_and_says_so_once(
    process: RobotProcess, client: Client, base: Base
) -> None:
    base.rest()
    off = client.call(SetAxis, "/wmx/axis/set_on", index=[1], data=[0])
    assert off.success, off.message
    first = len(base.sent)
    with base.driving(0.5, 0.0):
        assert base.stands()
        process.wait_output("right wheel: servo is off")
        for line in ("the base cannot move", "command rejected"):
            found = [printed for printed in process.output.splitlines() if line in printed]
            assert (
                len([problem for problem in found if "right wheel: servo is off" in problem]) <= 1
            )
        on = client.call(SetAxis, "/wmx/axis/set_on", index=[1], data=[1])
        assert on.success, on.message
        # The client has not noticed: it has to be released first. On a busy computer its thread
        # may be silent for as long.
        assert base.stands() or base.longest_silence_s(first) > TIMEOUT_S - SLACK_S
        process.wait_output("cmd_vel kept commanding while motion was rejected")
    base.rest()
    with base.driving(0.5, 0.0):
        wait_until(lambda: base.speed > 0.1, "it drives again")
    base.rest()


def check_commands_of_another_time_are_ignored(
    client: Client, publisher: Any, odometry: list[Any]
) -> None:
    message = TwistStamped()
    message.twist.linear.x = 0.3
    began = len(odometry)
    for seconds in (-5.0, 5.0):
        for _ in range(10):
            now = client.node.get_clock().now()
            message.header.stamp = (now + Duration(seconds=seconds)).to_msg()
            publisher.publish(message)
            client.next(odometry)
    assert max(abs(message.twist.twist.linear.x) for message in odometry[began:]) < 1e-3
    message.header.stamp = client.node.get_clock().now().to_msg()
    publisher.publish(message)
    client.next(odometry, lambda message: message.twist.twist.linear.x > 1e-3)
    client.next(odometry, lambda message: abs(message.twist.twist.linear.x) < 1e-3)


def check_pose_is_set(client: Client, odometry: list[Any]) -> None:
    poses = client.publisher(PoseWithCovarianceStamped, "/diff_drive_controller/set_pose")
    message = PoseWithCovarianceStamped()
    message.header.frame_id = "odom"
    message.pose.pose.position.x, message.pose.pose.position.y = 3.0, -1.0
    message.pose.pose.orientation.z = message.pose.pose.orientation.w = math.sqrt(0.5)
    poses.publish(message)
    found = client.next(
        odometry, lambda message: abs(message.pose.pose.position.x - 3.0) < 1e-6
    ).pose.pose
    # The base may still come to rest, along its new heading.
    expected = pytest.approx((-1.0, math.sqrt(0.5)), abs=1e-3)
    assert (found.position.y, found.orientation.z) == expected


def test_stamped_commands_and_a_client_of_the_other_type() -> None:
    with RobotProcess(*ros_args("use_stamped_vel:=true"), robot="baymax") as process:
        process.wait_ready()
        client, stranger = Client(process.domain), Client(process.domain)
        try:
            odometry = client.listen(Odometry, "/odom_enc")
            publisher = client.publisher(TwistStamped, "/cmd_vel")
            stranger.node.create_publisher(Twist, "/cmd_vel", 1)
            message = TwistStamped()
            message.twist.linear.x = 0.3

            def drives() -> bool:
                return bool(odometry) and odometry[-1].twist.twist.linear.x > 0.1

            command_until(lambda: publisher.publish(message), drives, "the base drives")
            client.next(odometry, lambda message: abs(message.twist.twist.linear.x) < 1e-3)
            check_commands_of_another_time_are_ignored(client, publisher, odometry)
            check_pose_is_set(client, odometry)
            process.wait_output("commands of another type are not received")
        finally:
            stranger.close()
            client.close()
        process.wait_output("commands of another type are gone")
        assert process.output.count("are not received") == 1
        assert "offered=['geometry_msgs/msg/Twist']" in process.output


@pytest.mark.parametrize(
    ("parameter", "reason"),
    [
        ("left_axis:=1", "left_axis: 1 contradicts drive.left_axis: 0 ("),
        ("wheel_radius:=0.0", "wheel_radius: 0.0 is not above 0"),
        ("pose_covariance_diagonal:=[1.0]", "pose_covariance_diagonal: 1 numbers instead of 6"),
        ("rate:=100000", "rate: 100000 is outside 1 to 200"),
        ("wmx_param_file_path:=/nowhere.xml", "file '/nowhere.xml' does not exist"),
    ],
)
def test_a_wrong_parameter_ends_it_before_anything_moves(parameter: str, reason: str) -> None:
    with RobotProcess(*ros_args(parameter), robot="baymax") as process:
        assert process.exit_status() == 3
        assert reason in process.output
        assert "device open" not in process.output
