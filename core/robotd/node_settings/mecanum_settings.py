"""Settings of ``mecanum_drive_controller``: the drive section of the robot under its parameters."""

from __future__ import annotations

from robotd.descriptor import MecanumDrive, RobotDescriptor
from robotd.node_settings.base_settings import BaseSettings, drive_of, read_base, read_limits
from robotd.node_settings.parameter_reader import ParameterReader

LEVER = "kinematics.sum_of_robot_center_projection_on_X_Y_axis"


def read_mecanum_drive(parameters: ParameterReader, descriptor: RobotDescriptor) -> BaseSettings:
    """Declare the parameters of ``mecanum_drive_controller``, with the names of ros2_controllers.

    Raises DescriptorError where the robot has no mecanum drive.
    """
    drive = drive_of(parameters.node, descriptor, MecanumDrive)
    stamped = parameters.flag("use_stamped_vel", True, "take TwistStamped instead of Twist")
    publishes_tf = parameters.flag("enable_odom_tf", True, "publish odom → base on ~/tf_odometry")
    return read_base(
        parameters,
        descriptor,
        drive=_drive(parameters, drive),
        stamped=stamped,
        commands="~/reference" if stamped else "~/reference_unstamped",
        wheel_speeds="~/wheel_speeds",
        odometry="~/odometry",
        transform="~/tf_odometry" if publishes_tf else "",
    )


def _drive(parameters: ParameterReader, drive: MecanumDrive) -> MecanumDrive:
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
            **read_limits(parameters, drive, "linear.x"),
            **read_limits(parameters, drive, "linear.y", "lateral_"),
            **read_limits(parameters, drive, "angular.z", "angular_", "rad"),
        }
    )
