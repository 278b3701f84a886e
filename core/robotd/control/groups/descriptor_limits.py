"""Names and limits that the descriptor gives the axes, and their agreement with the device."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pkgutil import resolve_name

import numpy as np

from robotd.arrays import FloatArray
from robotd.descriptor import (
    DriveSettings,
    OmnidirectionalDrive,
    RobotDescriptor,
    TrajectorySettings,
)
from robotd.descriptor.joint_settings import JointSettings
from robotd.device.drivers import AxisDriver
from robotd.entry_points import owner_of, plugin_errors
from robotd.errors import DescriptorError, PluginError
from robotd.motion import JointLimits, TrajectoryRules
from robotd.motion.base_kinematics import BaseKinematics, SteeredKinematics
from robotd.motion.base_twist_limits import RampLimits, TwistLimits
from robotd.motion.limits import AxisLimits
from robotd.motion.planar import PlanarTwist


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
    if drive := descriptor.drive:
        limits |= dict.fromkeys(drive.axes, wheel_limits(drive))
        limits |= {
            wheel.axis: AxisLimits(
                wheel.lower_rad, wheel.upper_rad, wheel.velocity_rad_s, wheel.acceleration_rad_s2
            )
            for wheel in drive.steering
        }
    return [limits.get(axis, AxisLimits.unlimited()) for axis in range(descriptor.axes)]


def joint_limits(
    joints: Sequence[JointSettings],
    limits: Sequence[AxisLimits],
    device_limits: Sequence[AxisLimits] = (),
) -> JointLimits:
    """Return the limits of ``joints``, from those of all axes; ``device_limits``: empty: none."""
    own = [limits[joint.axis] for joint in joints]
    device = [device_limits[joint.axis] for joint in joints if device_limits]
    return JointLimits(
        tuple(joint.name for joint in joints),
        np.array([limit.lower for limit in own]),
        np.array([limit.upper for limit in own]),
        np.array([limit.velocity for limit in own]),
        np.array([limit.acceleration for limit in own]),
        tuple(joint.unit for joint in joints),
        np.array([joint.jerk for joint in joints]),
        np.array([limit.velocity for limit in device]),
        np.array([limit.acceleration for limit in device]),
    )


def trajectory_rules(settings: TrajectorySettings, units: Sequence[str]) -> TrajectoryRules:
    """Return the rules of joints with ``units``, "rad" or "m" each."""

    def values(rad: float | None, m: float | None) -> FloatArray:
        by_unit = {"rad": math.inf if rad is None else rad, "m": math.inf if m is None else m}
        return np.array([by_unit[unit] for unit in units], np.float64)

    return TrajectoryRules(
        values(settings.path_tolerance_rad, settings.path_tolerance_m),
        values(settings.goal_tolerance_rad, settings.goal_tolerance_m),
        settings.goal_time_s,
        values(settings.start_tolerance_rad, settings.start_tolerance_m),
        values(settings.stopped_velocity_rad_s, settings.stopped_velocity_m_s),
        settings.max_points,
        settings.velocity_margin,
        settings.acceleration_margin,
        settings.allow_partial_joints_goal,
        settings.allow_nonzero_velocity_at_trajectory_end,
    )


def base_kinematics(settings: DriveSettings) -> BaseKinematics:
    """Return the kinematics of a base, made by its kind.

    Raises PluginError: the kind's function fails, or does not fit its settings.
    """
    owner = owner_of(type(settings).__module__)
    where = f"kind of base {settings.kind!r} of {owner}: {settings.KINEMATICS}"
    with plugin_errors(where, settings.KINEMATICS):
        wheels: object = resolve_name(settings.KINEMATICS)(settings)
    contract = SteeredKinematics if settings.steering else BaseKinematics
    if not isinstance(wheels, contract):
        lacking = [
            member for member in dir(contract) if member[0] != "_" and not hasattr(wheels, member)
        ]
        what = f"{type(wheels).__name__} has no {', '.join(lacking)}"
        raise PluginError(f"{where} returns no {contract.__name__}: {what}")
    steering = settings.steering_axes
    places = tuple(place for place, axis in enumerate(settings.axes) if axis in steering)
    if wheels.steered != places:
        raise PluginError(f"{where} steers {wheels.steered}, its settings {places}")
    return wheels


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


def _lateral_limits(settings: DriveSettings) -> RampLimits | None:
    if not isinstance(settings, OmnidirectionalDrive):
        return None
    return RampLimits(
        settings.lateral_velocity_m_s,
        settings.lateral_acceleration_m_s2,
        settings.lateral_deceleration_m_s2,
        settings.lateral_jerk_m_s3 or math.inf,
    )


MIN_SAMPLES = 2  # feedback periods within ``engine.stale_after_s``: one late value is not a fault


def fit_device(
    descriptor: RobotDescriptor, driver: AxisDriver, backend: str
) -> tuple[list[AxisLimits], list[str]]:
    """Return the limits of the axes on ``driver``, which need not be open, and notes.

    Each limit is the smaller of the descriptor's and the device's; a note is a text for each limit
    of the descriptor that exceeds the device's.

    Raises:
        DescriptorError: ``engine.stale_after_s`` is too short for the device's feedback, the
            position ranges of an axis have nothing in common, or a limit of a wheel exceeds the
            device's: a base has limits of its own, as a whole.
        PluginError: ``device_limits`` does not have one entry for each axis.
    """
    period_s, stale_s = driver.feedback_period_s, descriptor.engine.stale_after_s
    if stale_s < MIN_SAMPLES * period_s:
        raise DescriptorError(
            f"{stale_s:g} s is too short: new values of the {backend} backend come every"
            f" {period_s:g} s; set it to {MIN_SAMPLES * period_s:g} s or more",
            path=descriptor.path,
            key="engine.stale_after_s",
        )
    given = axis_limits(descriptor)
    device = tuple(driver.device_limits) or tuple(
        AxisLimits.unlimited(limit.unit) for limit in given
    )
    if len(device) != len(given):
        raise PluginError(
            f"backend {backend}: device_limits are of {len(device)} axes, the robot has"
            f" {len(given)}"
        )
    limits: list[AxisLimits] = []
    notes: list[str] = []
    wheels = descriptor.drive.axes if descriptor.drive else ()
    for axis, (name, own, other) in enumerate(
        zip(axis_names(descriptor), given, device, strict=True)
    ):
        limits.append(_within(name, own, other, backend, descriptor))
        exceeding = [f"{name}: {text}" for text in _exceeding(own, other)]
        if exceeding and axis in wheels:
            raise DescriptorError("; ".join(exceeding), path=descriptor.path, key="drive")
        notes += exceeding
    return limits, notes


def _within(
    name: str, given: AxisLimits, device: AxisLimits, backend: str, descriptor: RobotDescriptor
) -> AxisLimits:
    try:
        return given.within(device)
    except ValueError as error:
        raise DescriptorError(
            f"{name}: {error}; the latter are those of the {backend} backend", path=descriptor.path
        ) from error


def _exceeding(given: AxisLimits, device: AxisLimits) -> Iterator[str]:
    """Yield a text for each finite limit of ``given`` that exceeds that of ``device``."""
    unit = given.unit
    for what, own, other, sign, per in (
        ("lower limit", given.lower, device.lower, -1.0, unit),
        ("upper limit", given.upper, device.upper, 1.0, unit),
        ("velocity", given.velocity, device.velocity, 1.0, f"{unit}/s"),
        ("acceleration", given.acceleration, device.acceleration, 1.0, f"{unit}/s²"),
    ):
        if math.isfinite(own) and sign * own > sign * other:
            yield f"{what} {own:g} {per} exceeds the device's {other:g} {per}"
