"""Settings of ``diff_drive_controller``: the drive section of the robot under its parameters."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from robotd.descriptor import DriveSettings, RobotDescriptor
from robotd.errors import DescriptorError
from robotd.node_settings.arm_settings import FILE_MEANING
from robotd.node_settings.parameter_reader import ParameterReader

RATE_HZ = 10
LIMITED_TOPIC = "~/cmd_vel_out"

MULTIPLIERS = {
    "wheel_separation_multiplier": "distance between the wheels",
    "left_wheel_radius_multiplier": "radius of the left wheel",
    "right_wheel_radius_multiplier": "radius of the right wheel",
}

# Wheels measure x, y and yaw; sideways they do not slip; of the rest they know nothing.
NOT_MEASURED = 1e6
POSE_VARIANCES = (1e-3, 1e-3, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED, 1e-2)
TWIST_VARIANCES = (1e-3, 1e-3, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED, 1e-2)


class DiffDriveSettings(NamedTuple):
    """Settings of ``diff_drive_controller``.

    Attributes:
        drive: geometry and limits of the base.
        parameters_file: None: the robot's own.
        stamped: commands are ``TwistStamped`` instead of ``Twist``.
        commands, echo, wheel_speeds, odometry: topics.
        rate_hz: of the topics.
        odom_frame, base_frame: of the odometry, with their prefix.
        pose_variances, twist_variances: six each: x, y, z, roll, pitch, yaw.
        publish_tf: odom → base on ``/tf``.
        publish_limited: the limited command on ``LIMITED_TOPIC``.
        description: URDF to publish; "" for none.
    """

    drive: DriveSettings
    parameters_file: Path | None
    stamped: bool
    commands: str
    echo: str
    rate_hz: int
    wheel_speeds: str
    odometry: str
    odom_frame: str
    base_frame: str
    pose_variances: tuple[float, ...]
    twist_variances: tuple[float, ...]
    publish_tf: bool
    publish_limited: bool
    description: str


def read_diff_drive(parameters: ParameterReader, descriptor: RobotDescriptor) -> DiffDriveSettings:
    """Declare the parameters of ``diff_drive_controller``.

    Raises DescriptorError where the robot has no drive.
    """
    if descriptor.drive is None:
        raise DescriptorError(f"{parameters.node} needs a drive, which {descriptor.name} has not")
    highest = int(descriptor.cycle.rate_hz)
    prefix = parameters.text("frame_prefix", "", "put before the names of all frames")
    return DiffDriveSettings(
        _drive(parameters, descriptor.drive),
        parameters.file("wmx_param_file_path", FILE_MEANING),
        parameters.flag("use_stamped_vel", False, "take TwistStamped instead of Twist"),
        parameters.topic("cmd_vel_topic", "commands", required=True),
        parameters.topic("encoder_vel_topic", "echo of the commands", required=True),
        parameters.integer("rate", RATE_HZ, (1, highest), "rate of the topics in Hz"),
        parameters.topic("encoder_omega_topic", "speeds of the wheels", required=True),
        parameters.topic("encoder_odometry_topic", "odometry", required=True),
        prefix + parameters.text("odom_frame_id", "odom", "fixed frame of the odometry"),
        prefix + parameters.text("base_frame_id", "base_link", "frame of the base"),
        _variances(parameters, "pose_covariance_diagonal", POSE_VARIANCES),
        _variances(parameters, "twist_covariance_diagonal", TWIST_VARIANCES),
        parameters.flag("publish_tf", False, "publish odom → base on tf"),
        parameters.flag("publish_limited_velocity", False, f"publish {LIMITED_TOPIC}"),
        parameters.description(),
    )


def _variances(
    parameters: ParameterReader, name: str, default: tuple[float, ...]
) -> tuple[float, ...]:
    values = parameters.numbers(name, default, "variances of x, y, z, roll, pitch, yaw")
    if min(values) < 0.0:
        parameters.reject(name, f"{min(values)} is below 0")
    return values


def _drive(parameters: ParameterReader, drive: DriveSettings) -> DriveSettings:
    """Declare the parameters of geometry, ramps and limits; ``drive`` gives their defaults.

    ``acc_time`` and ``dec_time`` are the times between rest and the highest speed; a limit of
    acceleration that is lower wins.
    """
    parameters.same_as("drive.left_axis", "left_axis", drive.left_axis, "axis of the wheel")
    parameters.same_as("drive.right_axis", "right_axis", drive.right_axis, "axis of the wheel")
    linear = _limits(parameters, "linear.x", "m", drive.velocity_m_s, drive.acceleration_m_s2,
                     drive.deceleration_m_s2, drive.jerk_m_s3)  # fmt: skip
    angular = _limits(parameters, "angular.z", "rad", drive.angular_velocity_rad_s,
                      drive.angular_acceleration_rad_s2, drive.angular_deceleration_rad_s2,
                      drive.angular_jerk_rad_s3)  # fmt: skip
    acc_time = parameters.positive("acc_time", 1.0, "time from rest to the highest speed in s")
    dec_time = parameters.positive("dec_time", 1.0, "time from the highest speed to rest in s")
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
            "velocity_m_s": linear[0],
            "acceleration_m_s2": min(linear[1], linear[0] / acc_time),
            "deceleration_m_s2": min(linear[2], linear[0] / dec_time),
            "jerk_m_s3": linear[3],
            "angular_velocity_rad_s": angular[0],
            "angular_acceleration_rad_s2": min(angular[1], angular[0] / acc_time),
            "angular_deceleration_rad_s2": min(angular[2], angular[0] / dec_time),
            "angular_jerk_rad_s3": angular[3],
        }
    )


def _limits(
    parameters: ParameterReader,
    part: str,
    unit: str,
    velocity: float,
    acceleration: float,
    deceleration: float,
    jerk: float | None,
) -> tuple[float, float, float, float | None]:
    """The limits of one part of the twist, under the names that ros2_controllers gives them."""
    highest = parameters.number(f"{part}.max_jerk", jerk or 0.0, f"in {unit}/s³; 0: no limit")
    if highest < 0.0:
        parameters.reject(f"{part}.max_jerk", f"{highest} is below 0")
    return (
        parameters.positive(f"{part}.max_velocity", velocity, f"in {unit}/s"),
        parameters.positive(f"{part}.max_acceleration", acceleration, f"in {unit}/s²"),
        parameters.positive(f"{part}.max_deceleration", deceleration, f"in {unit}/s²"),
        highest or None,
    )
