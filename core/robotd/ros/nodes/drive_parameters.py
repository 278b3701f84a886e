"""Drive settings: the robot's drive section under the parameters of diff_drive_controller."""

from __future__ import annotations

from robotd.descriptor import DriveSettings
from robotd.ros.nodes.node_parameters import Parameters


def drive_settings(parameters: Parameters, drive: DriveSettings) -> DriveSettings:
    """Declare the parameters of geometry, ramps and limits; ``drive`` gives their defaults.

    ``acc_time`` and ``dec_time`` are the times between rest and the highest speed; a limit of
    acceleration that is lower wins. Raises DescriptorError.
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
    parameters: Parameters,
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
        raise parameters.error(f"{part}.max_jerk", f"{highest} is below 0")
    return (
        parameters.positive(f"{part}.max_velocity", velocity, f"in {unit}/s"),
        parameters.positive(f"{part}.max_acceleration", acceleration, f"in {unit}/s²"),
        parameters.positive(f"{part}.max_deceleration", deceleration, f"in {unit}/s²"),
        highest or None,
    )
