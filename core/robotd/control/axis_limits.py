"""Names and limits of a robot's axes, from its descriptor."""

from __future__ import annotations

import math

from robotd.descriptor import DriveSettings, RobotDescriptor
from robotd.motion.diff_drive import WheelPair
from robotd.motion.limits import AxisLimits
from robotd.motion.twist_limits import RampLimits, TwistLimits


def axis_names(descriptor: RobotDescriptor) -> list[str]:
    """Return the joints' names, and names of all other axes, by index."""
    names = {joint.axis: joint.name for joint in descriptor.joints}
    if descriptor.drive:
        names |= zip(descriptor.drive.axes, ("left wheel", "right wheel"), strict=True)
    return [names.get(axis, f"axis {axis}") for axis in range(descriptor.axes)]


def axis_limits(descriptor: RobotDescriptor) -> list[AxisLimits]:
    """Return the limits of each axis; those of axes without a part are infinite."""
    limits = {
        joint.axis: AxisLimits(
            joint.lower, joint.upper, joint.velocity, joint.acceleration, joint.unit
        )
        for joint in descriptor.joints
    }
    if descriptor.drive:
        limits |= dict.fromkeys(descriptor.drive.axes, wheel_limits(descriptor.drive))
    return [limits.get(axis, AxisLimits.unlimited()) for axis in range(descriptor.axes)]


def wheel_pair(settings: DriveSettings) -> WheelPair:
    """Return the calibrated kinematics of the base."""
    return WheelPair(
        settings.wheel_radius_m,
        settings.wheel_separation_m * settings.wheel_separation_multiplier,
        settings.left_wheel_radius_multiplier,
        settings.right_wheel_radius_multiplier,
    )


def twist_limits(settings: DriveSettings) -> TwistLimits:
    """Return the limits of the base as ``TwistLimits``; the smaller wheel limits the rims."""
    wheels = wheel_pair(settings)
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
        (settings.wheel_velocity_rad_s or math.inf) * min(wheels.radii),
        wheels.separation / 2,
    )


def wheel_limits(settings: DriveSettings) -> AxisLimits:
    """Return the limits of a wheel as an axis: its share of the fastest twist."""
    limits = twist_limits(settings)
    ramps = [max(part.acceleration, part.deceleration) for part in (limits.linear, limits.angular)]
    rim = limits.linear.velocity + limits.half_track * limits.angular.velocity
    radius = min(wheel_pair(settings).radii)
    return AxisLimits(
        -math.inf,
        math.inf,
        min(rim, limits.rim) / radius,
        (ramps[0] + limits.half_track * ramps[1]) / radius,
    )
