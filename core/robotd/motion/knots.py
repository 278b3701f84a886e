"""From a client's points to the knots of the path, the first being the start state."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.joints import JointLimits, MotionState
from robotd.motion.rejection import reject
from robotd.motion.request import Points

MIN_SPACING_S = 1e-3
# Times are sums of decimal fractions: 0.301 - 0.300 is a little less than 0.001.
_SPACING = MIN_SPACING_S * (1.0 - 1e-6)

# Largest velocity that counts as standing still in a goal: what is left when zero passes
# through single precision.
REST_VELOCITY = 1.2e-7


# A first point this near to the start (rad or m) is the present position. Far below the start
# tolerance, so that a point that means a small move keeps its time.
SAME_POSITION = 1e-4


def merge_close(points: Points, limits: JointLimits) -> Points:
    """Drop every point that comes less than 1 ms after the one kept before it.

    The last point is never lost: it replaces the one before it instead. Two points at the
    very same time must agree, because no joint can be at two places at once.
    """
    gaps = np.diff(points.times_s)
    if (gaps >= _SPACING).all():
        return points
    _check_simultaneous(points, gaps, limits)
    times = points.times_s.tolist()
    kept = [0]
    for index, time_s in enumerate(times):
        if time_s - times[kept[-1]] >= _SPACING:
            kept.append(index)
    last = len(times) - 1
    if kept[-1] != last:
        kept[-1] = last
    return points.select(kept)


def _check_simultaneous(points: Points, gaps: FloatArray, limits: JointLimits) -> None:
    apart = np.abs(np.diff(points.positions, axis=0)) > SAME_POSITION
    jumps = np.argwhere(apart & (gaps == 0.0)[:, None])
    if not len(jumps):
        return
    row, joint = jumps[0]
    before, after = points.positions[row : row + 2, joint]
    raise reject(
        f"{limits.names[joint]} at {points.times_s[row]:.3f} s: point {row + 1} is not later "
        f"than point {row} but asks for {after:.5g} {limits.units[joint]} after {before:.5g}"
    )


def attach_start(
    points: Points, start: MotionState, limits: JointLimits, start_tolerance: float
) -> Points:
    """Make ``start`` the knot at time 0; the path leaves it without a step.

    A first point at time 0 (or less than 1 ms later) or at the present position gives way to
    the start. Any other first point stays and is reached from the start in its own time.

    Args:
        start_tolerance: how far (rad or m) a first point at time 0 may be from the start.

    Raises:
        TrajectoryRejected: a first point at time 0 beyond ``start_tolerance``; an end that
            leaves no time to stop; a last point that does not stand still.
    """
    _check_end(points, limits)
    first = points.positions[0]
    distance = np.abs(first - start.position)
    at_zero = points.times_s[0] < _SPACING
    if at_zero and (distance > start_tolerance).any():
        joint = int(np.argmax(distance))
        raise reject(
            f"{limits.names[joint]} at 0.000 s: first point {first[joint]:.5g} is "
            f"{distance[joint]:.5g} {limits.units[joint]} away from the present position "
            f"{start.position[joint]:.5g}, start tolerance {start_tolerance:g} "
            f"{limits.units[joint]}"
        )
    present = len(points.times_s) > 1 and (distance <= SAME_POSITION).all()
    rest = points.select(slice(1, None)) if at_zero or present else points
    return _hold(points, start, limits) if len(rest.times_s) == 0 else _prepend(rest, start)


def _check_end(points: Points, limits: JointLimits) -> None:
    if points.velocities is None:
        return
    speed = np.abs(points.velocities[-1])
    joint = int(np.argmax(speed))
    if speed[joint] > REST_VELOCITY:
        raise reject(
            f"{limits.names[joint]} at {points.times_s[-1]:.3f} s: velocity "
            f"{points.velocities[-1, joint]:.5g} {limits.units[joint]}/s at the last point, "
            f"must be 0"
        )


def _hold(points: Points, start: MotionState, limits: JointLimits) -> Points:
    """A goal that is reached already: stand still for the shortest segment."""
    joint = int(np.argmax(np.abs(start.velocity)))
    if abs(start.velocity[joint]) > REST_VELOCITY:
        raise reject(
            f"{limits.names[joint]} at {points.times_s[-1]:.3f} s: the last point leaves no time "
            f"to stop from {start.velocity[joint]:.5g} {limits.units[joint]}/s"
        )
    zero = np.zeros((2, len(start.position)))
    return Points(np.array([0.0, MIN_SPACING_S]), np.array([start.position] * 2), zero, None)


def _prepend(points: Points, start: MotionState) -> Points:
    velocities = points.velocities
    if velocities is not None:
        velocities = np.vstack([start.velocity, velocities])
        velocities[-1] = 0.0
    accelerations = points.accelerations
    if accelerations is not None:
        accelerations = np.vstack([start.acceleration, accelerations])
    return Points(
        np.concatenate([[0.0], points.times_s]),
        np.vstack([start.position, points.positions]),
        velocities,
        accelerations,
    )
