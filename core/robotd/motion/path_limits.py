"""Limits along the whole path, between the points too."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.extremes import Extreme
from robotd.motion.joints import JointLimits, MotionState
from robotd.motion.peaks import PathPeaks
from robotd.motion.rejection import reject

# Rounding of a spline through a point that lies on the limit (rad or m, relative for rates).
_ROUNDING = 1e-6


def check_path_limits(
    peaks: PathPeaks, limits: JointLimits, velocity_margin: float, start: MotionState
) -> None:
    """Refuse a path that leaves the position limits or exceeds the velocity limits.

    A joint that stands outside its limits may come back but go no further out: its range
    reaches to ``start``. Every joint at fault is named, with its worst point.

    Raises:
        TrajectoryRejected: ``INVALID_GOAL``.
    """
    faults = [
        *_above(peaks.highest, "position", "", np.maximum(limits.upper, start.position), limits),
        *_below(peaks.lowest, np.minimum(limits.lower, start.position), limits),
        *_too_fast(peaks.velocity, limits, velocity_margin),
    ]
    if faults:
        raise reject("; ".join(faults))


def acceleration_notes(peaks: PathPeaks, limits: JointLimits) -> tuple[str, ...]:
    """A sentence for each joint above its acceleration limit.

    Not a rejection: planners limit acceleration at their own sampling, and the spline through
    the samples has peaks between them.
    """
    bound = limits.acceleration * (1.0 + _ROUNDING)
    return tuple(_above(peaks.acceleration, "acceleration", "/s²", bound, limits))


def _above(
    peak: Extreme, quantity: str, per: str, bound: FloatArray, limits: JointLimits
) -> list[str]:
    return [
        f"{limits.names[j]} at {peak.time_s[j]:.3f} s: {quantity} {peak.value[j]:.5g} "
        f"{limits.units[j]}{per} exceeds {bound[j]:.5g} {limits.units[j]}{per}"
        for j in np.flatnonzero(peak.value > bound + _ROUNDING)
    ]


def _below(peak: Extreme, bound: FloatArray, limits: JointLimits) -> list[str]:
    return [
        f"{limits.names[j]} at {peak.time_s[j]:.3f} s: position {peak.value[j]:.5g} "
        f"{limits.units[j]} is below {bound[j]:.5g} {limits.units[j]}"
        for j in np.flatnonzero(peak.value < bound - _ROUNDING)
    ]


def _too_fast(peak: Extreme, limits: JointLimits, margin: float) -> list[str]:
    bound = limits.velocity * (1.0 + margin) * (1.0 + _ROUNDING)
    return [
        f"{limits.names[j]} at {peak.time_s[j]:.3f} s: velocity {peak.value[j]:.5g} "
        f"{limits.units[j]}/s exceeds {limits.velocity[j]:.5g} {limits.units[j]}/s "
        f"(+{100.0 * margin:.3g} % margin)"
        for j in np.flatnonzero(peak.value > bound)
    ]
