"""Agreement of a robot's descriptor with the limits and the feedback period of its device."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from robotd.control.axis_limits import axis_limits, axis_names
from robotd.descriptor import RobotDescriptor
from robotd.device.drivers import AxisDriver
from robotd.errors import DescriptorError, PluginError
from robotd.motion.limits import AxisLimits

MIN_SAMPLES = 2  # feedback periods within ``engine.stale_after_s``: one late value is no fault


@dataclass(frozen=True)
class DeviceFit:
    """Limits of the axes on one device.

    Attributes:
        limits: per axis, the smaller of the descriptor's and the device's.
        notes: a text for each limit of the descriptor that exceeds the device's.
    """

    limits: tuple[AxisLimits, ...]
    notes: tuple[str, ...]


def fit_device(descriptor: RobotDescriptor, driver: AxisDriver, backend: str) -> DeviceFit:
    """Compare ``descriptor`` with ``driver``, which need not be open.

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
    device = tuple(driver.device_limits) or tuple(AxisLimits.unlimited(each.unit) for each in given)
    if len(device) != len(given):
        raise PluginError(
            f"backend {backend}: device_limits are of {len(device)} axes, the robot has"
            f" {len(given)}"
        )
    limits, notes = [], []
    wheels = descriptor.drive.axes if descriptor.drive else ()
    for axis, (name, own, other) in enumerate(
        zip(axis_names(descriptor), given, device, strict=True)
    ):
        limits.append(_within(name, own, other, backend, descriptor))
        exceeding = [f"{name}: {text}" for text in _exceeding(own, other)]
        if exceeding and axis in wheels:
            raise DescriptorError("; ".join(exceeding), path=descriptor.path, key="drive")
        notes += exceeding
    return DeviceFit(tuple(limits), tuple(notes))


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
