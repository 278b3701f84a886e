"""Settings of ``tricycle_controller``: the drive section of the robot under its parameters."""

from __future__ import annotations

from robotd.descriptor import RobotDescriptor, TricycleDrive
from robotd.node_settings.arm_settings import FILE_MEANING
from robotd.node_settings.base_settings import (
    ODOM_MEANING,
    POSE_VARIANCES,
    TF_MEANING,
    TF_TOPIC,
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


def read_tricycle(parameters: ParameterReader, descriptor: RobotDescriptor) -> BaseSettings:
    """Declare the parameters of ``tricycle_controller``, with the names of ros2_controllers.

    Raises DescriptorError where the robot has no tricycle drive.
    """
    drive = drive_of(parameters.node, descriptor, TricycleDrive)
    prefix = read_frame_prefix(parameters)
    return BaseSettings(
        drive=_drive(parameters, drive),
        parameters_file=parameters.file("wmx_param_file_path", FILE_MEANING),
        stamped=parameters.flag("use_stamped_vel", True, "take TwistStamped instead of Twist"),
        commands="~/cmd_vel",
        echo="",
        rate_hz=read_rate(parameters, descriptor),
        wheel_speeds="~/wheel_speeds",
        odometry="~/odom",
        transform=TF_TOPIC if parameters.flag("enable_odom_tf", True, TF_MEANING) else "",
        limited=read_limited_topic(parameters),
        odom_frame=prefix + parameters.text("odom_frame_id", "odom", ODOM_MEANING),
        base_frame=prefix + parameters.text("base_frame_id", "base_link", "frame of the base"),
        pose_variances=read_variances(parameters, "pose_covariance_diagonal", POSE_VARIANCES),
        twist_variances=read_variances(parameters, "twist_covariance_diagonal", TWIST_VARIANCES),
        description=parameters.description(),
    )


def _drive(parameters: ParameterReader, drive: TricycleDrive) -> TricycleDrive:
    """Declare the parameters of geometry and limits; ``drive`` gives their defaults."""
    linear = read_limits(parameters, "linear.x", "m", drive.velocity_m_s, drive.acceleration_m_s2,
                         drive.deceleration_m_s2, drive.jerk_m_s3)  # fmt: skip
    angular = read_limits(parameters, "angular.z", "rad", drive.angular_velocity_rad_s,
                          drive.angular_acceleration_rad_s2, drive.angular_deceleration_rad_s2,
                          drive.angular_jerk_rad_s3)  # fmt: skip
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
            "velocity_m_s": linear[0],
            "acceleration_m_s2": linear[1],
            "deceleration_m_s2": linear[2],
            "jerk_m_s3": linear[3],
            "angular_velocity_rad_s": angular[0],
            "angular_acceleration_rad_s2": angular[1],
            "angular_deceleration_rad_s2": angular[2],
            "angular_jerk_rad_s3": angular[3],
        }
    )
