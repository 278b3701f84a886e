"""Limits along the whole path, between the points too."""

from __future__ import annotations

import math

import numpy as np

from robotd.arrays import BoolArray, FloatArray
from robotd.descriptor.model import TrajectorySettings
from robotd.motion.digits import distinct
from robotd.motion.extremes import Extreme, PathPeaks
from robotd.motion.joints import JointLimits, MotionState
from robotd.motion.rejection import reject

# Rounding of a spline through a point that lies on the limit (rad or m, relative for rates).
_ROUNDING = 1e-6


class _Bound:
    """Bound of a rate: a limit with its margin, or the device's limit if smaller.

    Attributes:
        value: (m,) in the unit of the rate.
        limit: (m,) limit that ``value`` comes from, without the margin.
    """

    def __init__(self, limit: FloatArray, margin: float, device: FloatArray) -> None:
        self.value: FloatArray = np.minimum(limit * (1.0 + margin), device)
        self._by_device, self._margin = device <= self.value, margin
        self.limit: FloatArray = np.where(self._by_device, device, limit)

    def note(self, joint: int) -> str:
        """Return the end of a sentence that names ``limit``."""
        if self._by_device[joint]:
            return " (limit of the device)"
        return f" (+{100.0 * self._margin:.3g} % margin)"


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
    upper, lower = peaks.highest.value, peaks.lowest.value
    highest = np.maximum(limits.upper, start.position)
    lowest = np.minimum(limits.lower, start.position)
    above, below = upper > highest + _ROUNDING, lower < lowest - _ROUNDING
    faults = [
        *_texts(peaks.highest, above, "position", "exceeds", highest, "", limits),
        *_texts(peaks.lowest, below, "position", "is below", lowest, "", limits),
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
    peak = peaks.acceleration
    ratio = peak.value / limits.acceleration
    bound = np.where(ratio < ratio.max(), np.inf, limits.acceleration * (1.0 + _ROUNDING))
    beyond = peak.value > bound + _ROUNDING
    return tuple(_texts(peak, beyond, "acceleration", "exceeds", bound, "/s²", limits)[:1])


def _beyond_bound(
    peak: Extreme, quantity: str, per: str, bound: _Bound, limits: JointLimits
) -> list[str]:
    beyond = peak.value > bound.value * (1.0 + _ROUNDING)
    texts = _texts(peak, beyond, quantity, "exceeds", bound.limit, per, limits)
    joints = np.flatnonzero(beyond).tolist()
    return [text + bound.note(joint) for text, joint in zip(texts, joints, strict=True)]


def _texts(
    peak: Extreme,
    beyond: BoolArray,
    quantity: str,
    relation: str,
    bound: FloatArray,
    per: str,
    limits: JointLimits,
) -> list[str]:
    """Return a sentence for each joint whose ``peak`` is ``beyond`` its ``bound``."""
    texts = []
    for joint in np.flatnonzero(beyond).tolist():
        unit = limits.units[joint] + per
        value, limit = distinct(float(peak.value[joint]), float(bound[joint]))
        texts.append(
            f"{limits.names[joint]} at {peak.time_s[joint]:.3f} s: {quantity} {value} {unit} "
            f"{relation} {limit} {unit}"
        )
    return texts
