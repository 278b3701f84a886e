"""Settings of ``tricycle_controller``: the drive section of the robot under its parameters."""

from __future__ import annotations

from robotd.descriptor import RobotDescriptor, TricycleDrive
from robotd.node_settings.base_settings import (
    TF_MEANING,
    TF_TOPIC,
    BaseSettings,
    drive_of,
    read_base,
    read_limits,
)
from robotd.node_settings.parameter_reader import ParameterReader


def read_tricycle(parameters: ParameterReader, descriptor: RobotDescriptor) -> BaseSettings:
    """Declare the parameters of ``tricycle_controller``, with the names of ros2_controllers.

    Raises DescriptorError where the robot has no tricycle drive.
    """
    drive = drive_of(parameters.node, descriptor, TricycleDrive)
    return read_base(
        parameters,
        descriptor,
        drive=_drive(parameters, drive),
        stamped=parameters.flag("use_stamped_vel", True, "take TwistStamped instead of Twist"),
        commands="~/cmd_vel",
        wheel_speeds="~/wheel_speeds",
        odometry="~/odom",
        transform=TF_TOPIC if parameters.flag("enable_odom_tf", True, TF_MEANING) else "",
    )


def _drive(parameters: ParameterReader, drive: TricycleDrive) -> TricycleDrive:
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
            **read_limits(parameters, drive, "linear.x"),
            **read_limits(parameters, drive, "angular.z", "angular_", "rad"),
        }
    )
