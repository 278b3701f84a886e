"""Change from a motion under way to a longer one along the same path, without a stop.

Both lead along the same curve of the joints, but may be differently fast there. From the place of
the change on the longer motion is passed at a rate that begins with the velocity and the
acceleration of the motion under way, and fades to 1.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray
from robotd.api.robots import JointLimits
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.paths.path_outputs import TimedOutput
from robotd_tool_space.paths.tool_curves import ToolSpeed
from robotd_tool_space.paths.tool_motion import (
    FINEST_KNOT_S,
    ToolMotion,
    limit_excess,
    place_on,
    sampled,
    tool_bounds,
    tool_excess,
    tool_poses,
)

STEP_S = 0.04  # between the places that are tried
MAX_PLACES = 25
FADES_S = (0.1, 0.2, 0.4, 0.8)
LOWEST_RATE, HIGHEST_RATE = 0.8, 1.25  # at the change: beyond it the motion slows down already
SAME_PATH = 1e-4  # rad or m between the two curves
SAME_DIRECTION = 0.02  # of the velocity
MIN_VELOCITY = 1e-3  # rad/s or m/s; slower is at rest
DIFFERENCE_S = 1e-3
MAX_JOINT_EXCESS, MAX_TOOL_EXCESS = 1.0 + 1e-6, 1.008  # of time: 1.6 % of an acceleration


class JoinedMotion(NamedTuple):
    """Motion that is the one under way up to ``same_s``."""

    motion: ToolMotion
    same_s: float


def join(
    running: ToolMotion,
    longer: ToolMotion,
    after_s: float,
    limits: JointLimits,
    kinematics: Kinematics,
    speed: ToolSpeed,
) -> JoinedMotion | None:
    """Return the motion that changes from ``running`` to ``longer``, as soon as possible.

    Args:
        running: with the first segments of ``longer``.
        after_s: its time at which the change may begin.
        limits, kinematics, speed: see ``plan_sequence``.

    Returns None where no change keeps the limits of joints and tool: it slows down for its end.
    """
    for number in range(MAX_PLACES):
        at_s = after_s + number * STEP_S
        if at_s >= running.duration_s - FINEST_KNOT_S:
            break
        begin = _begin(running, longer, at_s)
        if begin is None:
            continue
        for fade_s in FADES_S:
            motion = _changed(running, longer, begin, fade_s)
            if motion is None or limit_excess(motion, limits) > MAX_JOINT_EXCESS:
                continue
            times_s, tool = tool_poses(kinematics, motion)
            if tool_excess(times_s, tool, speed) <= MAX_TOOL_EXCESS:
                bounds = tool_bounds(times_s, tool, speed)
                return JoinedMotion(replace(motion, rate_bounds=bounds), at_s)
    return None


class _Begin(NamedTuple):
    """Place of a change: times of both motions, and the rate of the longer one with its slope."""

    at_s: float
    place_s: float
    rate: float
    slope: float


def _begin(running: ToolMotion, longer: ToolMotion, at_s: float) -> _Begin | None:
    """Return how a change at ``at_s`` begins; None: the two are not on the same path there."""
    position, velocity, acceleration = _state(running, at_s)
    if np.abs(velocity).max() < MIN_VELOCITY:
        return None
    # Only the same segment: a path may pass a place several times.
    number = int(np.searchsorted(running.ends_s, at_s))
    edges_s = (0.0, *longer.ends_s)
    middle_s = 0.5 * (edges_s[number] + edges_s[number + 1])
    reach_s = 0.5 * (edges_s[number + 1] - edges_s[number])
    place_s = place_on(longer, position, middle_s, reach_s)
    there, along, bend = _state(longer, place_s)
    for _ in range(3):
        if not np.abs(along).max() >= MIN_VELOCITY:
            return None
        place_s += float((position - there) @ along / (along @ along))
        there, along, bend = _state(longer, place_s)
    rate = float(velocity @ along / (along @ along))
    slope = float((acceleration - rate**2 * bend) @ along / (along @ along))
    same_place = np.abs(position - there).max() <= SAME_PATH
    off = np.abs(velocity - rate * along).max()
    same_direction = off <= SAME_DIRECTION * np.abs(velocity).max()
    if not (same_place and same_direction and LOWEST_RATE <= rate <= HIGHEST_RATE):
        return None
    return _Begin(at_s, place_s, rate, slope)


def _changed(
    running: ToolMotion, longer: ToolMotion, begin: _Begin, fade_s: float
) -> ToolMotion | None:
    """Return the motion that changes within ``fade_s``; None: the rate falls too low meanwhile."""
    since_s = np.linspace(0.0, fade_s, int(np.ceil(fade_s / FINEST_KNOT_S)) + 1)
    part = since_s / fade_s
    # Hermite: from ``rate`` with ``slope`` to 1 without; and its integral.
    excess, slope = begin.rate - 1.0, begin.slope * fade_s
    rates = 1.0 + excess * (2 * part**3 - 3 * part**2 + 1) + slope * (part**3 - 2 * part**2 + part)
    fading = excess * (part**4 / 2 - part**3 + part)
    rising = slope * (part**4 / 4 - 2 * part**3 / 3 + part**2 / 2)
    passed_s = begin.place_s + since_s + fade_s * (fading + rising)
    if rates.min() < 0.5 or passed_s[-1] > longer.duration_s - FINEST_KNOT_S:
        return None
    positions, velocities = sampled(longer, passed_s)
    velocities *= rates[:, None]
    at = np.array([begin.at_s])
    positions[:1], velocities[:1] = sampled(running, at)
    before = running.times_s < begin.at_s - DIFFERENCE_S
    after = longer.times_s > passed_s[-1] + FINEST_KNOT_S / 2.0
    shift_s = begin.at_s + fade_s - float(passed_s[-1])

    def moved(time_s: float) -> float:
        """Return the time at which ``time_s`` of the longer motion comes."""
        if time_s >= passed_s[-1]:
            return time_s + shift_s
        return begin.at_s + float(np.interp(time_s, passed_s, since_s))

    kept = [end_s for end_s in running.ends_s if end_s <= begin.at_s]
    later = tuple(moved(end_s) for end_s in longer.ends_s[len(kept) :])
    outputs = tuple(timed for timed in running.outputs if timed.time_s <= begin.at_s) + tuple(
        TimedOutput(moved(time_s), output)
        for time_s, output in longer.outputs
        if time_s > begin.place_s
    )
    return replace(
        longer,
        times_s=np.concatenate(
            [running.times_s[before], begin.at_s + since_s, longer.times_s[after] + shift_s]
        ),
        positions=np.vstack([running.positions[before], positions, longer.positions[after]]),
        velocities=np.vstack([running.velocities[before], velocities, longer.velocities[after]]),
        ends_s=(*kept, *later),
        outputs=outputs,
    )


def _state(motion: ToolMotion, time_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities and accelerations (n,) at one time."""
    times_s = np.array([time_s - DIFFERENCE_S, time_s, time_s + DIFFERENCE_S])
    positions, velocities = sampled(motion, np.clip(times_s, 0.0, motion.duration_s))
    return positions[1], velocities[1], (velocities[2] - velocities[0]) / (2.0 * DIFFERENCE_S)
