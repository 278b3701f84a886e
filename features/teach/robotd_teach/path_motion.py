"""Motion along a recorded path: as it was recorded, or as fast as a part of the limits allows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd.api.robots import JointLimits
from robotd_teach.path_curve import PathCurve, tolerances
from robotd_tool_space.paths.timing import Timing, time_curve
from robotd_tool_space.paths.tool_motion import (
    ACCELERATION_SHARE,
    KNOT_S,
    SMOOTH_S,
    ToolMotion,
    knot_times,
    knots_at,
    plan_fast_motion,
    sampled,
    within_limits,
)

FIRST_KNOTS, MAX_KNOTS = 500, 2000  # of a motion; the motion to the start needs some, too
MAX_CHECKS = 100_000  # places at which a motion is compared with its curve
PLANNED_SHARE = 0.5  # of the tolerance: of the planned motion from the curve of the path
APPROACH_SPEED = 0.2  # of the joints' limits, on the way to a path


class PathTiming(Enum):
    """Reference of the speed of a path."""

    RECORDED = "recorded"  # of the recorded one; slower where the limits demand it
    LIMITS = "limits"  # of the joints' limits of velocity and acceleration


@dataclass(frozen=True, eq=False)
class PathMotion:
    """Motion to a path, and along it.

    Attributes:
        motion: all of it, from where the arm is.
        approach_s: time at which the path begins.
        deviation: (n,) largest distance of each joint from the curve of the path.
        parts: of the recorded time of the path at each point of ``motion``, 0 to 1; those before
            the path have that of its start.
    """

    motion: ToolMotion
    approach_s: float
    deviation: FloatArray
    parts: FloatArray


def curve_of(
    times_s: FloatArray,
    points: FloatArray,
    limits: JointLimits,
    *,
    reverse: bool = False,
    begin: float = 0.0,
) -> PathCurve:
    """Return the curve of a path as it is played.

    ``begin``: part of its time that is left out first.
    Raises InvalidArgument: nothing moves from there on.
    """
    if reverse:
        times_s, points = times_s[-1] - times_s[::-1], points[::-1]
    return PathCurve.through(times_s, points, tolerances(limits.units), begin * times_s[-1])


def plan_path(
    curve: PathCurve,
    limits: JointLimits,
    start: FloatArray,
    speed: float,
    timing: PathTiming,
) -> PathMotion:
    """Return the motion from ``start`` (n,) to a path and along it, at rest at both ends.

    A pure function, for a worker thread. The limits of the joints are kept, and the curve within
    half of the tolerance of a recording.

    Args:
        speed: 0.01 to 1, a part of what ``timing`` names.

    Raises InvalidArgument: it takes more than an hour, or too many points.
    """
    share = speed if timing is PathTiming.LIMITS else 1.0
    recorded = timing is PathTiming.RECORDED
    bounds = replace(
        limits, velocity=share * limits.velocity, acceleration=share * limits.acceleration
    )
    caps = curve.rates * speed if recorded else np.full_like(curve.at_s, np.inf)
    timed = time_curve(
        curve,
        [*curve.pauses_s],
        bounds.velocity,
        ACCELERATION_SHARE * bounds.acceleration,
        caps,
        SMOOTH_S,
    )
    motion, deviation, at_s = _kept(curve, timed, bounds)
    parts = np.interp(at_s, curve.at_s, curve.times_s / curve.times_s[-1])
    if recorded:
        motion, parts = _with_pauses(motion, parts, at_s, curve, speed)
    if not (curve.positions[0] - start).any():
        return PathMotion(motion, 0.0, deviation, parts)
    approach = approach_to(limits, start, curve.positions[0])
    approach_s = approach.duration_s
    return PathMotion(
        ToolMotion(
            np.concatenate([approach.times_s, approach_s + motion.times_s[1:]]),
            np.vstack([approach.positions, motion.positions[1:]]),
            np.vstack([approach.velocities, motion.velocities[1:]]),
        ),
        approach_s,
        deviation,
        np.concatenate([np.full(len(approach.times_s), parts[0]), parts[1:]]),
    )


def approach_to(limits: JointLimits, start: FloatArray, goal: FloatArray) -> ToolMotion:
    """Return the motion of all joints together to where a path begins, (n,) each."""
    return plan_fast_motion(limits, start, goal, APPROACH_SPEED)


def approach_text(limits: JointLimits, start: FloatArray, goal: FloatArray) -> str:
    """Return how far and long it is to where a path begins; "": the joints are there."""
    distances = goal - start
    away = np.abs(distances) / tolerances(limits.units)
    if away.max() <= 1.0:
        return ""
    joint, others = int(away.argmax()), int((away > 1.0).sum()) - 1
    more = f" and {others} more joint{'s' if others > 1 else ''}" if others else ""
    travel = f"{limits.names[joint]} by {distances[joint]:+.3f} {limits.units[joint]}{more}"
    return f"{travel}, {approach_to(limits, start, goal).duration_s:.1f} s"


def require_at_start(limits: JointLimits, start: FloatArray, goal: FloatArray) -> None:
    """Raise InvalidArgument where the joints are away from where a path begins."""
    if approach := approach_text(limits, start, goal):
        raise InvalidArgument(f"the path begins elsewhere: {approach}; `approach` goes there first")


def _kept(
    curve: PathCurve, timed: Timing, limits: JointLimits
) -> tuple[ToolMotion, FloatArray, FloatArray]:
    """Return the motion that keeps the curve, its deviation (n,), and distances of its points."""
    end_s, tolerance = timed.times_s[-1], tolerances(limits.units)
    checked_s = np.linspace(0.0, end_s, min(len(timed.times_s), MAX_CHECKS))
    wanted, _ = curve.exact(timed.at(checked_s)[0])
    times_s = knot_times(timed, max(KNOT_S, end_s / FIRST_KNOTS))
    while True:
        raw = knots_at(curve, timed, times_s)
        off = np.abs(sampled(raw, checked_s)[0] - wanted)
        far = checked_s[(off > PLANNED_SHARE * tolerance).any(axis=1)]
        if not len(far):
            return within_limits(raw, limits), off.max(axis=0), timed.at(times_s)[0]
        before = np.unique(np.searchsorted(times_s, far, "right") - 1)
        times_s = np.sort([*times_s, *0.5 * (times_s[before] + times_s[before + 1])])
        if len(times_s) > MAX_KNOTS:
            text = f"the path needs more than {MAX_KNOTS} points to be kept: record it in parts"
            raise InvalidArgument(text)


def _with_pauses(
    motion: ToolMotion, parts: FloatArray, at_s: FloatArray, curve: PathCurve, speed: float
) -> tuple[ToolMotion, FloatArray]:
    """Return a motion, and the parts at its points, with the recorded pauses."""
    index = [int(np.abs(at_s - curve.at_s[stop]).argmin()) for stop in curve.pauses_s]
    waits_s = np.array([*curve.pauses_s.values()]) / speed
    chosen = [(place, wait_s) for place, wait_s in zip(index, waits_s, strict=True) if wait_s > 0.0]
    if not chosen:
        return motion, parts
    places = np.array([place for place, _ in chosen]) + 1
    delay_s = np.zeros(len(parts))
    for place, wait_s in chosen:
        delay_s[place + 1 :] += wait_s
    ends_s = motion.times_s[places - 1] + delay_s[places - 1] + [wait_s for _, wait_s in chosen]
    return (
        ToolMotion(
            np.insert(motion.times_s + delay_s, places, ends_s),
            np.insert(motion.positions, places, motion.positions[places - 1], axis=0),
            np.insert(motion.velocities, places, motion.velocities[places - 1], axis=0),
        ),
        np.insert(parts, places, parts[places - 1]),
    )
