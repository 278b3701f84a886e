"""Names and limits of a robot's axes and of its base, from its descriptor."""

from __future__ import annotations

import math

from robotd.descriptor import (
    DriveSettings,
    MecanumDrive,
    RobotDescriptor,
    TricycleDrive,
    TwoSidedDrive,
)
from robotd.motion.base_kinematics import BaseKinematics
from robotd.motion.diff_drive import TwoSidedWheels
from robotd.motion.limits import AxisLimits
from robotd.motion.mecanum import MecanumWheels
from robotd.motion.planar import PlanarTwist
from robotd.motion.steering import SteeringLimits
from robotd.motion.tricycle import SteeredWheels
from robotd.motion.twist_limits import RampLimits, TwistLimits


def axis_names(descriptor: RobotDescriptor) -> list[str]:
    """Return the joints' names, and names of all other axes, by index."""
    names = {joint.axis: joint.name for joint in descriptor.joints}
    if descriptor.drive:
        names |= zip(descriptor.drive.axes, descriptor.drive.wheel_names, strict=True)
    return [names.get(axis, f"axis {axis}") for axis in range(descriptor.axes)]


def axis_limits(descriptor: RobotDescriptor) -> list[AxisLimits]:
    """Return the descriptor's limits of each axis; those of axes without a part are infinite."""
    limits = {
        joint.axis: AxisLimits(
            joint.lower, joint.upper, joint.velocity, joint.acceleration, joint.unit
        )
        for joint in descriptor.joints
    }
    if descriptor.drive:
        limits |= dict.fromkeys(descriptor.drive.axes, wheel_limits(descriptor.drive))
        if isinstance(descriptor.drive, TricycleDrive):
            limits[descriptor.drive.steering_axis] = _steering_limits(descriptor.drive)
    return [limits.get(axis, AxisLimits.unlimited()) for axis in range(descriptor.axes)]


def base_kinematics(settings: DriveSettings) -> BaseKinematics:
    """Return the kinematics of a base, calibrated, for its kind."""
    match settings:
        case TwoSidedDrive():
            return TwoSidedWheels(
                settings.wheel_radius_m,
                settings.wheel_separation_m * settings.wheel_separation_multiplier,
                settings.left_wheel_radius_multiplier,
                settings.right_wheel_radius_multiplier,
                settings.wheels_per_side,
            )
        case MecanumDrive():
            return MecanumWheels(
                settings.wheel_radius_m, settings.wheel_separation_m, settings.wheelbase_m
            )
        case TricycleDrive():
            return steered_wheels(settings)
        case _:
            raise TypeError(f"no kinematics of {type(settings).__name__}")


def steered_wheels(settings: TricycleDrive) -> SteeredWheels:
    """Return the kinematics of a steered base."""
    return SteeredWheels(
        settings.wheel_radius_m,
        settings.wheelbase_m,
        settings.traction == "steered",
        settings.steering_angle_rad,
    )


def steering_limits(settings: TricycleDrive) -> SteeringLimits:
    """Return the limits of steering, and the ramp of the driven wheel."""
    return SteeringLimits(
        settings.steering_velocity_rad_s,
        settings.steering_acceleration_rad_s2,
        wheel_limits(settings).acceleration,
    )


def twist_limits(settings: DriveSettings) -> TwistLimits:
    """Return the limits of the base as ``TwistLimits``; the smallest wheel limits the rims."""
    wheels = base_kinematics(settings)
    return TwistLimits(
        RampLimits(
            settings.velocity_m_s,
            settings.acceleration_m_s2,
            settings.deceleration_m_s2,
            settings.jerk_m_s3 or math.inf,
        ),
        RampLimits(
            settings.angular_velocity_rad_s,
            settings.angular_acceleration_rad_s2,
            settings.angular_deceleration_rad_s2,
            settings.angular_jerk_rad_s3 or math.inf,
        ),
        (settings.wheel_velocity_rad_s or math.inf) * wheels.radius,
        wheels.lever,
        _lateral_limits(settings),
    )


def wheel_limits(settings: DriveSettings) -> AxisLimits:
    """Return the limits of a wheel as an axis: its share of the fastest twist."""
    limits = twist_limits(settings)
    radius = base_kinematics(settings).radius
    fastest = PlanarTwist(*(part.velocity for part in limits.parts))
    steepest = PlanarTwist(*(max(part.acceleration, part.deceleration) for part in limits.parts))
    return AxisLimits(
        -math.inf,
        math.inf,
        min(limits.rim_speed(fastest), limits.rim) / radius,
        limits.rim_speed(steepest) / radius,
    )


def _steering_limits(settings: TricycleDrive) -> AxisLimits:
    angle = settings.steering_angle_rad
    return AxisLimits(
        -angle, angle, settings.steering_velocity_rad_s, settings.steering_acceleration_rad_s2
    )


def _lateral_limits(settings: DriveSettings) -> RampLimits | None:
    if not isinstance(settings, MecanumDrive):
        return None
    return RampLimits(
        settings.lateral_velocity_m_s,
        settings.lateral_acceleration_m_s2,
        settings.lateral_deceleration_m_s2,
        settings.lateral_jerk_m_s3 or math.inf,
    )
