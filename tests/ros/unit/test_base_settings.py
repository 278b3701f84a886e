"""Parameters of the nodes of bases, and of the robot state publisher, read without ROS."""

from __future__ import annotations

from typing import Any

import pytest

from robotd.control.groups.descriptor_limits import base_kinematics
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.errors import DescriptorError
from robotd.plugin.parameter_reader import ParameterReader
from robotd_bases.mecanum import MecanumDrive
from robotd_bases.tricycle import TricycleDrive
from robotd_ros.nodes.base_settings import (
    read_diff_drive,
    read_mecanum_drive,
    read_tricycle,
)
from robotd_ros.nodes.device_settings import read_state_publisher

MECANUM = "mecanum_drive_controller"
TRICYCLE = "tricycle_controller"
LEVER = "kinematics.sum_of_robot_center_projection_on_X_Y_axis"


def reader(robot: str, node: str, **values: Any) -> tuple[ParameterReader, RobotDescriptor]:
    """Reader of a node of a robot, with ``values`` beside the parameters of the descriptor."""
    descriptor = load_robot_descriptor(robot)
    parameters = {node: {**descriptor.ros_parameters.get(node, {}), **values}}
    changed = descriptor.model_copy(update={"ros_parameters": parameters})
    return ParameterReader(node, changed), changed


def test_a_mecanum_base_takes_its_limits_from_the_drive() -> None:
    parameters, descriptor = reader("mecanum_base", MECANUM)
    settings = read_mecanum_drive(parameters, descriptor)
    parameters.done()
    assert settings.drive == descriptor.drive
    assert (settings.commands, settings.stamped) == ("~/reference", True)
    assert settings.transform == "~/tf_odometry"
    assert (settings.limited, settings.echo) == ("", "")


def test_parameters_of_a_mecanum_base_win_over_the_drive() -> None:
    parameters, descriptor = reader(
        "mecanum_base",
        MECANUM,
        use_stamped_vel=False,
        enable_odom_tf=False,
        publish_limited_velocity=True,
        frame_prefix="a/",
        reference_timeout=0.2,
        **{
            LEVER: 0.82,
            "kinematics.wheels_radius": 0.08,
            "linear.x.max_jerk": 0.0,
            "linear.y.max_velocity": 0.1,
            "linear.y.max_deceleration": 0.2,
            "angular.z.max_acceleration": 3.0,
        },
    )
    settings = read_mecanum_drive(parameters, descriptor)
    parameters.done()
    drive = settings.drive
    assert isinstance(drive, MecanumDrive)
    assert base_kinematics(drive).lever == pytest.approx(0.82)
    assert drive.wheel_separation_m / drive.wheelbase_m == pytest.approx(0.38 / 0.44)
    assert (drive.wheel_radius_m, drive.command_timeout_s) == (0.08, 0.2)
    assert (drive.jerk_m_s3, drive.lateral_velocity_m_s) == (None, 0.1)
    assert (drive.lateral_deceleration_m_s2, drive.lateral_acceleration_m_s2) == (0.2, 1.0)
    assert drive.angular_acceleration_rad_s2 == 3.0
    assert settings.commands == "~/reference_unstamped"
    assert (settings.transform, settings.limited) == ("", "~/cmd_vel_out")
    assert (settings.odom_frame, settings.base_frame) == ("a/odom", "a/base_footprint")


def test_a_tricycle_takes_its_limits_from_the_drive() -> None:
    parameters, descriptor = reader("tricycle_base", TRICYCLE)
    settings = read_tricycle(parameters, descriptor)
    parameters.done()
    assert settings.drive == descriptor.drive
    assert (settings.commands, settings.odometry) == ("~/cmd_vel", "~/odom")
    assert settings.stamped


def test_parameters_of_a_tricycle_win_over_the_drive() -> None:
    parameters, descriptor = reader(
        "tricycle_base",
        TRICYCLE,
        wheelbase=0.9,
        wheel_radius=0.11,
        cmd_vel_timeout=0.3,
        enable_odom_tf=False,
        frame_prefix="a/",
        **{"linear.x.max_velocity": 0.4, "angular.z.max_acceleration": 0.5},
    )
    settings = read_tricycle(parameters, descriptor)
    parameters.done()
    drive = settings.drive
    assert isinstance(drive, TricycleDrive)
    assert (drive.wheelbase_m, drive.wheel_radius_m, drive.command_timeout_s) == (0.9, 0.11, 0.3)
    assert (drive.velocity_m_s, drive.angular_acceleration_rad_s2) == (0.4, 0.5)
    assert drive.acceleration_m_s2 == 1.0
    assert settings.transform == ""
    assert (settings.odom_frame, settings.base_frame) == ("a/odom", "a/base_footprint")


@pytest.mark.parametrize(
    ("robot", "node", "reason"),
    [
        ("mecanum_base", "diff_drive_controller", "cannot move a mecanum base"),
        ("baymax", MECANUM, "cannot move a differential base"),
        ("cr3a", MECANUM, "needs a drive, which cr3a has not"),
        ("mecanum_base", TRICYCLE, "cannot move a mecanum base"),
    ],
)
def test_a_base_of_another_kind_is_rejected(robot: str, node: str, reason: str) -> None:
    parameters, descriptor = reader(robot, node)
    read = {MECANUM: read_mecanum_drive, TRICYCLE: read_tricycle}.get(node, read_diff_drive)
    with pytest.raises(DescriptorError, match=reason):
        read(parameters, descriptor)


def test_multipliers_of_a_differential_base() -> None:
    parameters, descriptor = reader(
        "baymax", "diff_drive_controller", wheel_separation_multiplier=1.1,
        left_wheel_radius_multiplier=0.99, right_wheel_radius_multiplier=1.01,
    )  # fmt: skip
    kinematics = base_kinematics(read_diff_drive(parameters, descriptor).drive)
    parameters.done()
    assert kinematics.radius == pytest.approx(0.09 * 0.99)
    assert kinematics.lever == pytest.approx(0.55 * 1.1 / 2)


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_a_multiplier_is_positive(value: float) -> None:
    parameters, descriptor = reader(
        "baymax", "diff_drive_controller", wheel_separation_multiplier=value
    )
    read_diff_drive(parameters, descriptor)
    with pytest.raises(DescriptorError, match=f"wheel_separation_multiplier: {value} is not above"):
        parameters.done()


def test_frames_are_published_at_50_hz() -> None:
    parameters, descriptor = reader("cr3a", "robot_state_publisher", frame_prefix="left/")
    settings = read_state_publisher(parameters, descriptor)
    parameters.done()
    assert (settings.prefix, settings.rate_hz) == ("left/", 50.0)


@pytest.mark.parametrize(
    ("robot", "frequency", "reason"),
    [
        ("cr3a", 501.0, "publish_frequency: 501 is above 500"),
        ("cr3a", 0.0, "publish_frequency: 0.0 is not above 0"),
        ("standalone", 50.0, "robot_description: standalone has no urdf"),
    ],
)
def test_a_state_publisher_that_cannot_publish(robot: str, frequency: float, reason: str) -> None:
    parameters, descriptor = reader(robot, "robot_state_publisher", publish_frequency=frequency)
    read_state_publisher(parameters, descriptor)
    with pytest.raises(DescriptorError, match=reason):
        parameters.done()


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"base_frame_id": "odom"}, "base_frame_id: 'odom' is the frame of the odometry"),
        ({"odom_frame_id": "base_link"}, "base_frame_id: 'base_link' is the frame of the odometry"),
        ({"base_frame_id": ""}, "base_frame_id: '' is not a valid name of a frame: it is empty"),
        (
            {"odom_frame_id": "/odom"},
            "odom_frame_id: '/odom' is not a valid name of a frame: tf allows no",
        ),
        (
            {"base_frame_id": "base link"},
            "base_frame_id: 'base link' is not a valid name of a frame: it has",
        ),
        ({"frame_prefix": "/left/"}, "frame_prefix: '/left/' cannot begin a frame: tf allows no"),
    ],
)
@pytest.mark.parametrize(
    ("robot", "node", "read"),
    [
        ("baymax", "diff_drive_controller", read_diff_drive),
        ("skid_steer_base", "diff_drive_controller", read_diff_drive),
        ("mecanum_base", MECANUM, read_mecanum_drive),
        ("tricycle_base", TRICYCLE, read_tricycle),
    ],
)
def test_frames_that_tf_cannot_have_are_rejected(
    robot: str, node: str, read: Any, values: dict[str, str], problem: str
) -> None:
    defaults = {"odom_frame_id": "odom", "base_frame_id": "base_link"}
    parameters, descriptor = reader(robot, node, **{**defaults, **values})
    read(parameters, descriptor)
    with pytest.raises(DescriptorError, match=problem):
        parameters.done()


def test_a_missing_topic_is_named_with_the_place_to_set_it() -> None:
    parameters, descriptor = reader("baymax", "diff_drive_controller", cmd_vel_topic="")
    read_diff_drive(parameters, descriptor)
    what = (
        r"cmd_vel_topic: is empty, but needs a name \(commands\): set it under"
        r" ros_parameters.diff_drive_controller of the robot, or by -p cmd_vel_topic:=NAME"
    )
    with pytest.raises(DescriptorError, match=what):
        parameters.done()
