"""Checks of a path: close points, the last point, and limits between the points too."""

from __future__ import annotations

import math

import numpy as np

from robotd.arrays import BoolArray, FloatArray
from robotd.motion.extremes import Extreme, PathPeaks
from robotd.motion.joints import JointLimits, MotionState, TrajectoryRules
from robotd.motion.rejection import distinct, reject
from robotd.motion.request import REST_VELOCITY, TrajectoryRequest

MIN_SPACING_S = 1e-3
# Times are sums of decimal fractions: 0.301 - 0.300 is a little less than 0.001.
ROUNDED_SPACING_S = MIN_SPACING_S * (1.0 - 1e-6)

ALLOW_END_VELOCITY = "trajectory.allow_nonzero_velocity_at_trajectory_end"

# Positions closer than this (rad or m) are the same. Far below the start tolerance, so that a
# point that means a small move keeps its time.
SAME_POSITION = 1e-4


def merge_close(points: TrajectoryRequest, limits: JointLimits) -> TrajectoryRequest:
    """Drop every point that comes less than 1 ms after the one kept before it.

    The last point is never dropped: it replaces the one before it instead. Two points at the
    very same time must agree, because no joint can be at two places at once.
    """
    gaps = np.diff(points.times_s)
    if (gaps >= ROUNDED_SPACING_S).all():
        return points
    _check_simultaneous(points, gaps, limits)
    times = points.times_s.tolist()
    kept = [0]
    for index, time_s in enumerate(times):
        if time_s - times[kept[-1]] >= ROUNDED_SPACING_S:
            kept.append(index)
    last = len(times) - 1
    if kept[-1] != last:
        kept[-1] = last
    return points.select(kept)


def merge_note(points: TrajectoryRequest, merged: TrajectoryRequest) -> tuple[str, ...]:
    """Return a sentence on the points that ``merge_close`` dropped, if any."""
    dropped = len(points.times_s) - len(merged.times_s)
    return (f"{dropped} points less than 1 ms after another were merged",) if dropped else ()


def check_end(points: TrajectoryRequest, limits: JointLimits, *, may_move: bool) -> None:
    """Reject a last point with a velocity, unless it ``may_move`` and comes after time 0.

    Raises TrajectoryRejected: naming joint, time and velocity.
    """
    if points.velocities is None:
        return
    speed = np.abs(points.velocities[-1])
    joint = int(np.argmax(speed))
    moves = speed[joint] > REST_VELOCITY
    if moves and not (may_move and points.times_s[-1] >= ROUNDED_SPACING_S):
        why = "at time 0" if may_move else f"({ALLOW_END_VELOCITY} is false)"
        raise reject(
            f"{limits.names[joint]} at {points.times_s[-1]:.3f} s: velocity "
            f"{points.velocities[-1, joint]:.5g} {limits.units[joint]}/s at the last point, "
            f"must be 0 {why}"
        )


def _check_simultaneous(points: TrajectoryRequest, gaps: FloatArray, limits: JointLimits) -> None:
    apart = np.abs(np.diff(points.positions, axis=0)) > SAME_POSITION
    jumps = np.argwhere(apart & (gaps == 0.0)[:, None])
    if not len(jumps):
        return
    row, joint = jumps[0]
    before, after = distinct(*points.positions[row : row + 2, joint].tolist())
    raise reject(
        f"{limits.names[joint]} at {points.times_s[row]:.3f} s: point {row + 1} is not later "
        f"than point {row} but asks for {after} {limits.units[joint]} after {before}"
    )


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
    peaks: PathPeaks, limits: JointLimits, rules: TrajectoryRules, start: MotionState
) -> None:
    """Reject a path that leaves the position limits or exceeds velocity or acceleration limits.

    A joint outside its limits may come back but go no further out: its range
    reaches to ``start``. Every joint at fault is named, with its worst point. With
    ``rules.acceleration_margin`` None accelerations are checked against the device's limits
    only. The margins do not extend those.

    Raises TrajectoryRejected: ``INVALID_GOAL``.
    """
    velocity = _Bound(limits.velocity, rules.velocity_margin, limits.device_velocity)
    margin = rules.acceleration_margin
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
