"""Limits along the whole path, between the points too."""

from __future__ import annotations

import math

import numpy as np

from robotd.arrays import FloatArray
from robotd.descriptor.model import TrajectorySettings
from robotd.motion.digits import distinct
from robotd.motion.extremes import Extreme, PathPeaks
from robotd.motion.joints import JointLimits, MotionState
from robotd.motion.rejection import reject

# Rounding of a spline through a point that lies on the limit (rad or m, relative for rates).
_ROUNDING = 1e-6


class _Bound:
    """Bound of a rate: a limit with its margin, or the device's limit if smaller.

    Arrays of shape (m,), in the unit of the rate.
    """

    def __init__(self, limit: FloatArray, margin: float, device: FloatArray) -> None:
        self._limit, self._margin, self._device = limit, margin, device
        self.value: FloatArray = np.minimum(limit * (1.0 + margin), device)

    def limit(self, joint: int) -> float:
        """Return the limit that ``value`` comes from, without the margin."""
        return float((self._device if self._by_device(joint) else self._limit)[joint])

    def note(self, joint: int) -> str:
        """Return the end of a sentence that names ``limit``."""
        if self._by_device(joint):
            return " (limit of the device)"
        return f" (+{100.0 * self._margin:.3g} % margin)"

    def _by_device(self, joint: int) -> bool:
        return bool(self._device[joint] <= self.value[joint])


def check_path_limits(
    peaks: PathPeaks, limits: JointLimits, settings: TrajectorySettings, start: MotionState
) -> None:
    """Reject a path that leaves the position limits or exceeds velocity or acceleration limits.

    A joint that stands outside its limits may come back but go no further out: its range
    reaches to ``start``. Every joint at fault is named, with its worst point. With
    ``settings.acceleration_margin`` None accelerations are checked against the device's limits
    only. The margins do not extend those.

    Raises:
        TrajectoryRejected: ``INVALID_GOAL``.
    """
    velocity = _Bound(limits.velocity, settings.velocity_margin, limits.device_velocity)
    margin = settings.acceleration_margin
    acceleration = _Bound(
        limits.acceleration, math.inf if margin is None else margin, limits.device_acceleration
    )
    faults = [
        *_above(peaks.highest, "position", "", np.maximum(limits.upper, start.position), limits),
        *_below(peaks.lowest, np.minimum(limits.lower, start.position), limits),
        *_beyond_bound(peaks.velocity, "velocity", "/s", velocity, limits),
    ]
    if found := _beyond_bound(peaks.acceleration, "acceleration", "/s²", acceleration, limits):
        by_acceleration = math.sqrt(float(np.max(peaks.acceleration.value / acceleration.value)))
        by_velocity = float(np.max(peaks.velocity.value / velocity.value))
        slower = math.ceil(100.0 * max(by_acceleration, by_velocity)) / 100.0
        faults += [*found, f"allow the motion {slower:.2f} times its time"]
    if faults:
        raise reject("; ".join(faults))


def acceleration_notes(peaks: PathPeaks, limits: JointLimits) -> tuple[str, ...]:
    """Describe the joint that exceeds its acceleration limit most, if any.

    Planners limit acceleration at their own sampling; the polynomials through the samples
    have peaks between them.
    """
    ratio = peaks.acceleration.value / limits.acceleration
    bound = np.where(ratio < ratio.max(), np.inf, limits.acceleration * (1.0 + _ROUNDING))
    return tuple(_above(peaks.acceleration, "acceleration", "/s²", bound, limits)[:1])


def _above(
    peak: Extreme, quantity: str, per: str, bound: FloatArray, limits: JointLimits
) -> list[str]:
    return [
        _sentence(peak, j, quantity, "exceeds", bound[j], limits.units[j] + per, limits)
        for j in np.flatnonzero(peak.value > bound + _ROUNDING).tolist()
    ]


def _below(peak: Extreme, bound: FloatArray, limits: JointLimits) -> list[str]:
    return [
        _sentence(peak, j, "position", "is below", bound[j], limits.units[j], limits)
        for j in np.flatnonzero(peak.value < bound - _ROUNDING).tolist()
    ]


def _beyond_bound(
    peak: Extreme, quantity: str, per: str, bound: _Bound, limits: JointLimits
) -> list[str]:
    return [
        _sentence(peak, j, quantity, "exceeds", bound.limit(j), limits.units[j] + per, limits)
        + bound.note(j)
        for j in np.flatnonzero(peak.value > bound.value * (1.0 + _ROUNDING)).tolist()
    ]


def _sentence(
    peak: Extreme,
    joint: int,
    quantity: str,
    relation: str,
    bound: float,
    unit: str,
    limits: JointLimits,
) -> str:
    value, limit = distinct(float(peak.value[joint]), float(bound))
    return (
        f"{limits.names[joint]} at {peak.time_s[joint]:.3f} s: {quantity} {value} {unit} "
        f"{relation} {limit} {unit}"
    )
