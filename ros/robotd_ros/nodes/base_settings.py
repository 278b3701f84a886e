"""Settings of the nodes of mobile bases: a drive section under their ROS parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from robotd.descriptor import DriveSettings, RobotDescriptor
from robotd.errors import DescriptorError
from robotd.plugin.parameter_reader import ParameterReader
from robotd_bases.diff_drive import TwoSidedDrive
from robotd_bases.mecanum import MecanumDrive
from robotd_bases.tricycle import TricycleDrive
from robotd_ros.nodes.arm_settings import FILE_MEANING
from robotd_ros.nodes.device_settings import read_frame_prefix

RATE_HZ = 10
LIMITED_TOPIC = "~/cmd_vel_out"
TF_TOPIC = "tf"
TF_MEANING = "publish odom → base on tf"
LEVER = "kinematics.sum_of_robot_center_projection_on_X_Y_axis"

Kind = TypeVar("Kind", bound=DriveSettings)

MULTIPLIERS = {
    "wheel_separation_multiplier": "distance between the wheels",
    "left_wheel_radius_multiplier": "radius of the left wheels",
    "right_wheel_radius_multiplier": "radius of the right wheels",
}

# Wheels measure x, y and yaw; sideways they do not slip; of the rest they know nothing.
NOT_MEASURED = 1e6
POSE_VARIANCES = (1e-3, 1e-3, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED, 1e-2)
TWIST_VARIANCES = (1e-3, 1e-3, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED, 1e-2)


class BaseSettings(NamedTuple):
    """Settings of the node of a mobile base.

    An optional topic that is "" is not offered.

    Attributes:
        drive: geometry and limits of the base.
        parameters_file: None: the robot's own.
        stamped: commands are ``TwistStamped`` instead of ``Twist``.
        commands, wheel_speeds, odometry: topics.
        echo, limited, transform: optional topics: commands as received, limited commands, and
            the transform odom → base.
        rate_hz: of the topics.
        odom_frame, base_frame: of the odometry, with their prefix.
        pose_variances, twist_variances: six each: x, y, z, roll, pitch, yaw.
        description: URDF to publish; "" for none.
    """

    drive: DriveSettings
    parameters_file: Path | None
    stamped: bool
    commands: str
    rate_hz: int
    wheel_speeds: str
    odometry: str
    transform: str
    limited: str
    odom_frame: str
    base_frame: str
    pose_variances: tuple[float, ...]
    twist_variances: tuple[float, ...]
    description: str
    echo: str = ""


def _drive_of(node: str, descriptor: RobotDescriptor, kind: type[Kind]) -> Kind:
    """Return the drive of a robot. Raises DescriptorError: none, or of another kind."""
    drive = descriptor.drive
    if drive is None:
        raise DescriptorError(f"{node} needs a drive, which {descriptor.name} has not")
    if not isinstance(drive, kind):
        what = f"{node} cannot move a {drive.kind} base: see drive.kind of {descriptor.name}"
        raise DescriptorError(what)
    return drive


def read_diff_drive(parameters: ParameterReader, descriptor: RobotDescriptor) -> BaseSettings:
    """Declare the parameters of ``diff_drive_controller``.

    Raises DescriptorError where the robot has neither a differential nor a skid-steer drive.
    """
    drive = _drive_of(parameters.node, descriptor, TwoSidedDrive)
    return BaseSettings(
        drive=_diff_drive(parameters, drive),
        stamped=parameters.flag("use_stamped_vel", False, "take TwistStamped instead of Twist"),
        commands=parameters.topic("cmd_vel_topic", "commands", required=True),
        echo=parameters.topic("encoder_vel_topic", "echo of the commands", required=True),
        wheel_speeds=parameters.topic("encoder_omega_topic", "speeds of the wheels", required=True),
        odometry=parameters.topic("encoder_odometry_topic", "odometry", required=True),
        transform=TF_TOPIC if parameters.flag("publish_tf", False, TF_MEANING) else "",
        **_common(parameters, descriptor),
    )


def _diff_drive(parameters: ParameterReader, drive: TwoSidedDrive) -> TwoSidedDrive:
    """Declare the parameters of geometry, ramps and limits; ``drive`` gives their defaults.

    ``acc_time`` and ``dec_time`` are the times between rest and the highest speed; a limit of
    acceleration that is lower wins.
    """
    for key in drive.AXIS_KEYS:
        parameters.same_as(f"drive.{key}", key, getattr(drive, key), "axis of the wheels")
    limits = _limits(parameters, drive, "linear.x")
    limits |= _limits(parameters, drive, "angular.z", "angular_", "rad")
    acc_time = parameters.positive("acc_time", 1.0, "time from rest to the highest speed in s")
    dec_time = parameters.positive("dec_time", 1.0, "time from the highest speed to rest in s")
    for speed, ramp, time_s in (
        ("velocity_m_s", "acceleration_m_s2", acc_time),
        ("velocity_m_s", "deceleration_m_s2", dec_time),
        ("angular_velocity_rad_s", "angular_acceleration_rad_s2", acc_time),
        ("angular_velocity_rad_s", "angular_deceleration_rad_s2", dec_time),
    ):
        limits[ramp] = min(limits[ramp], limits[speed] / time_s)
    return drive.model_copy(
        update={
            "wheel_radius_m": parameters.positive(
                "wheel_radius", drive.wheel_radius_m, "radius of the wheels in m"
            ),
            "wheel_separation_m": parameters.positive(
                "wheel_to_wheel", drive.wheel_separation_m, "distance between the wheels in m"
            ),
            **{
                name: parameters.positive(name, getattr(drive, name), f"factor of the {of}")
                for name, of in MULTIPLIERS.items()
            },
            "command_timeout_s": parameters.positive(
                "cmd_vel_timeout", drive.command_timeout_s, "age of a command that stops, in s"
            ),
            **limits,
        }
    )


def read_mecanum_drive(parameters: ParameterReader, descriptor: RobotDescriptor) -> BaseSettings:
    """Declare the parameters of ``mecanum_drive_controller``, with the names of ros2_controllers.

    Raises DescriptorError where the robot has no mecanum drive.
    """
    drive = _drive_of(parameters.node, descriptor, MecanumDrive)
    stamped = parameters.flag("use_stamped_vel", True, "take TwistStamped instead of Twist")
    publishes_tf = parameters.flag("enable_odom_tf", True, "publish odom → base on ~/tf_odometry")
    return BaseSettings(
        drive=_mecanum_drive(parameters, drive),
        stamped=stamped,
        commands="~/reference" if stamped else "~/reference_unstamped",
        wheel_speeds="~/wheel_speeds",
        odometry="~/odometry",
        transform="~/tf_odometry" if publishes_tf else "",
        **_common(parameters, descriptor),
    )


def _mecanum_drive(parameters: ParameterReader, drive: MecanumDrive) -> MecanumDrive:
    """Declare the parameters of geometry and limits; ``drive`` gives their defaults."""
    lever = (drive.wheel_separation_m + drive.wheelbase_m) / 2
    factor = parameters.positive(LEVER, lever, "half of track plus wheelbase in m") / lever
    return drive.model_copy(
        update={
            "wheel_radius_m": parameters.positive(
                "kinematics.wheels_radius", drive.wheel_radius_m, "radius of the wheels in m"
            ),
            "wheel_separation_m": drive.wheel_separation_m * factor,
            "wheelbase_m": drive.wheelbase_m * factor,
            "command_timeout_s": parameters.positive(
                "reference_timeout", drive.command_timeout_s, "age of a command that stops, in s"
            ),
            **_limits(parameters, drive, "linear.x"),
            **_limits(parameters, drive, "linear.y", "lateral_"),
            **_limits(parameters, drive, "angular.z", "angular_", "rad"),
        }
    )


def read_tricycle(parameters: ParameterReader, descriptor: RobotDescriptor) -> BaseSettings:
    """Declare the parameters of ``tricycle_controller``, with the names of ros2_controllers.

    Raises DescriptorError where the robot has no tricycle drive.
    """
    drive = _drive_of(parameters.node, descriptor, TricycleDrive)
    return BaseSettings(
        drive=_tricycle_drive(parameters, drive),
        stamped=parameters.flag("use_stamped_vel", True, "take TwistStamped instead of Twist"),
        commands="~/cmd_vel",
        wheel_speeds="~/wheel_speeds",
        odometry="~/odom",
        transform=TF_TOPIC if parameters.flag("enable_odom_tf", True, TF_MEANING) else "",
        **_common(parameters, descriptor),
    )


def _tricycle_drive(parameters: ParameterReader, drive: TricycleDrive) -> TricycleDrive:
    """Declare the parameters of geometry and limits; ``drive`` gives their defaults."""
    return drive.model_copy(
        update={
            "wheel_radius_m": parameters.positive(
                "wheel_radius", drive.wheel_radius_m, "radius of the driven wheel in m"
            ),
            "wheelbase_m": parameters.positive(
                "wheelbase", drive.wheelbase_m, "fixed axle to steered wheel in m"
            ),
            "command_timeout_s": parameters.positive(
                "cmd_vel_timeout", drive.command_timeout_s, "age of a command that stops, in s"
            ),
            **_limits(parameters, drive, "linear.x"),
            **_limits(parameters, drive, "angular.z", "angular_", "rad"),
        }
    )


def _common(parameters: ParameterReader, descriptor: RobotDescriptor) -> dict[str, Any]:
    """Declare the parameters that all bases have; return the settings by name."""
    prefix = read_frame_prefix(parameters)
    highest = int(descriptor.cycle.rate_hz)
    odom_frame = parameters.frame("odom_frame_id", "odom", "fixed frame of the odometry", prefix)
    base_frame = parameters.frame("base_frame_id", "base_link", "frame of the base", prefix)
    if odom_frame == base_frame:
        what = f"{base_frame!r} is the frame of the odometry (odom_frame_id) too: they must differ"
        parameters.reject("base_frame_id", what)
    limited = parameters.flag("publish_limited_velocity", False, f"publish {LIMITED_TOPIC}")
    return {
        "parameters_file": parameters.file("wmx_param_file_path", FILE_MEANING),
        "rate_hz": parameters.integer("rate", RATE_HZ, (1, highest), "rate of the topics in Hz"),
        "limited": LIMITED_TOPIC if limited else "",
        "odom_frame": odom_frame,
        "base_frame": base_frame,
        "pose_variances": _variances(parameters, "pose_covariance_diagonal", POSE_VARIANCES),
        "twist_variances": _variances(parameters, "twist_covariance_diagonal", TWIST_VARIANCES),
        "description": parameters.description(),
    }


def _variances(
    parameters: ParameterReader, name: str, default: tuple[float, ...]
) -> tuple[float, ...]:
    """Declare six variances, at least 0."""
    values = parameters.numbers(name, default, "variances of x, y, z, roll, pitch, yaw")
    if min(values) < 0.0:
        parameters.reject(name, f"{min(values)} is below 0")
    return values


def _limits(
    parameters: ParameterReader, drive: DriveSettings, part: str, prefix: str = "", unit: str = "m"
) -> dict[str, Any]:
    """Declare velocity, acceleration, deceleration and jerk of one part of the twist.

    The names are those of ros2_controllers. A jerk of 0 is not limited.

    Args:
        drive: gives the defaults.
        part: of the twist, as in the names of the parameters.
        prefix, unit: of the fields of ``drive``.

    Returns:
        Fields of ``drive``, by name.
    """
    default = getattr(drive, f"{prefix}jerk_{unit}_s3") or 0.0
    jerk = parameters.number(f"{part}.max_jerk", default, f"in {unit}/s³; 0: no limit")
    if jerk < 0.0:
        parameters.reject(f"{part}.max_jerk", f"{jerk} is below 0")
    found: dict[str, Any] = {f"{prefix}jerk_{unit}_s3": jerk or None}
    for kind, per, shown in (
        ("velocity", "s", "s"),
        ("acceleration", "s2", "s²"),
        ("deceleration", "s2", "s²"),
    ):
        field = f"{prefix}{kind}_{unit}_{per}"
        name = f"{part}.max_{kind}"
        found[field] = parameters.positive(name, getattr(drive, field), f"in {unit}/{shown}")
    return found
