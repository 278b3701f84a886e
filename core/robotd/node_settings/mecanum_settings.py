"""Settings of ``mecanum_drive_controller``: the drive section of the robot under its parameters."""

from __future__ import annotations

from robotd.descriptor import MecanumDrive, RobotDescriptor
from robotd.node_settings.arm_settings import FILE_MEANING
from robotd.node_settings.base_settings import (
    ODOM_MEANING,
    POSE_VARIANCES,
    TWIST_VARIANCES,
    BaseSettings,
    drive_of,
    read_limited_topic,
    read_limits,
    read_rate,
    read_variances,
)
from robotd.node_settings.device_settings import read_frame_prefix
from robotd.node_settings.parameter_reader import ParameterReader

LEVER = "kinematics.sum_of_robot_center_projection_on_X_Y_axis"


def read_mecanum_drive(parameters: ParameterReader, descriptor: RobotDescriptor) -> BaseSettings:
    """Declare the parameters of ``mecanum_drive_controller``, with the names of ros2_controllers.

    Raises DescriptorError where the robot has no mecanum drive.
    """
    drive = drive_of(parameters.node, descriptor, MecanumDrive)
    prefix = read_frame_prefix(parameters)
    stamped = parameters.flag("use_stamped_vel", True, "take TwistStamped instead of Twist")
    publishes_tf = parameters.flag("enable_odom_tf", True, "publish odom → base on ~/tf_odometry")
    return BaseSettings(
        drive=_drive(parameters, drive),
        parameters_file=parameters.file("wmx_param_file_path", FILE_MEANING),
        stamped=stamped,
        commands="~/reference" if stamped else "~/reference_unstamped",
        echo="",
        rate_hz=read_rate(parameters, descriptor),
        wheel_speeds="~/wheel_speeds",
        odometry="~/odometry",
        transform="~/tf_odometry" if publishes_tf else "",
        limited=read_limited_topic(parameters),
        odom_frame=prefix + parameters.text("odom_frame_id", "odom", ODOM_MEANING),
        base_frame=prefix + parameters.text("base_frame_id", "base_link", "frame of the base"),
        pose_variances=read_variances(parameters, "pose_covariance_diagonal", POSE_VARIANCES),
        twist_variances=read_variances(parameters, "twist_covariance_diagonal", TWIST_VARIANCES),
        description=parameters.description(),
    )


def _drive(parameters: ParameterReader, drive: MecanumDrive) -> MecanumDrive:
    """Declare the parameters of geometry and limits; ``drive`` gives their defaults."""
    lever = (drive.wheel_separation_m + drive.wheelbase_m) / 2
    factor = parameters.positive(LEVER, lever, "half of track plus wheelbase in m") / lever
    linear = read_limits(parameters, "linear.x", "m", drive.velocity_m_s, drive.acceleration_m_s2,
                         drive.deceleration_m_s2, drive.jerk_m_s3)  # fmt: skip
    lateral = read_limits(parameters, "linear.y", "m", drive.lateral_velocity_m_s,
                          drive.lateral_acceleration_m_s2, drive.lateral_deceleration_m_s2,
                          drive.lateral_jerk_m_s3)  # fmt: skip
    angular = read_limits(parameters, "angular.z", "rad", drive.angular_velocity_rad_s,
                          drive.angular_acceleration_rad_s2, drive.angular_deceleration_rad_s2,
                          drive.angular_jerk_rad_s3)  # fmt: skip
    kinds = ("velocity", "acceleration", "deceleration", "jerk")
    units = ("m_s", "m_s2", "m_s2", "m_s3")
    limits = {
        f"{prefix}{kind}_{unit}": value
        for prefix, values in (("", linear), ("lateral_", lateral))
        for kind, unit, value in zip(kinds, units, values, strict=True)
    } | {
        f"angular_{kind}_{unit.replace('m', 'rad')}": value
        for kind, unit, value in zip(kinds, units, angular, strict=True)
    }
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
            **limits,
        }
    )
