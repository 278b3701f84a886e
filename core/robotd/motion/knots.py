"""Points less than a millisecond apart, and the last point."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.digits import distinct
from robotd.motion.joints import JointLimits
from robotd.motion.rejection import reject
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

    Raises:
        TrajectoryRejected: naming joint, time and velocity.
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
