"""Motion of a tool as a trajectory of the joints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from robotd.api import FloatArray
from robotd.api.robots import JointLimits, RateBounds, TrajectoryRequest
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import pose_differences
from robotd_tool_space.paths.joint_path import hermite
from robotd_tool_space.paths.path_outputs import TimedOutput
from robotd_tool_space.paths.timing import Curve, Timing
from robotd_tool_space.paths.tool_curves import ToolSpeed

KNOT_S = 0.05  # between points of the trajectory
FINEST_KNOT_S = 0.0125
MAX_KNOTS = 2500
CHECK_S = 0.002  # between the times at which the result is checked
MAX_CHECKS = 20_000
ACCELERATION_SHARE = 0.75  # of the joints' limits; cubics between the points have peaks above it
SMOOTH_S = 0.1
NO_SPEED = 1e-9
RAMP_S = 0.3  # of trajectory time, in which a motion goes on from rest
QUINTIC_VELOCITY, QUINTIC_ACCELERATION = 1.875, 5.7735  # peaks of d/T and d/T² at rest on both ends


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Points of a trajectory.

    Attributes:
        times_s: (k,) from 0.
        positions, velocities: (k, n), rad or m; at rest at both ends.
        deviation_m, deviation_rad: largest distance from the line at any period, planned.
        path_s: duration at full speed of the tool; the joints may make it longer.
        rate_bounds: by which changes of speed on the way keep the accelerations of the tool; None:
            they keep those of the joints only.
        ends_s: times at the ends of its segments: in the middle of their corners.
        outputs: that are set on the way.
        notes: what is not as it was asked for, such as corners that are stops.
    """

    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray
    deviation_m: float = 0.0
    deviation_rad: float = 0.0
    path_s: float = 0.0
    rate_bounds: RateBounds | None = None
    ends_s: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    outputs: tuple[TimedOutput, ...] = ()

    @property
    def duration_s(self) -> float:
        """Time of the last point."""
        return float(self.times_s[-1])

    def slower(self, factor: float) -> ToolMotion:
        """Return the same path in ``factor`` times its duration."""
        return replace(
            self,
            times_s=self.times_s * factor,
            velocities=self.velocities / factor,
            ends_s=tuple(end_s * factor for end_s in self.ends_s),
            outputs=tuple(TimedOutput(time_s * factor, output) for time_s, output in self.outputs),
        )

    def request(self, joints: tuple[str, ...]) -> TrajectoryRequest:
        """Return the trajectory that it is, for the n joints by name."""
        return TrajectoryRequest(
            joints, self.times_s, self.positions, self.velocities, rate_bounds=self.rate_bounds
        )


def plan_joint_motion(
    kinematics: Kinematics,
    limits: JointLimits,
    start: FloatArray,
    goal: FloatArray,
    speed: ToolSpeed,
    part: float = 1.0,
) -> ToolMotion:
    """Return the motion of all joints together to ``goal`` (n,).

    Args:
        kinematics, limits, start, speed: see ``plan_sequence``.
        goal: positions, rad or m.
        part: 0 to 1 of the joints' speeds.
    """
    shortest_s = _shortest_s(limits, start, goal, part)
    if shortest_s == 0.0:
        return standing(start)
    place = _quintic(np.linspace(0.0, 1.0, 101))
    poses = kinematics.forward(start + place[:, None] * (goal - start))
    steps = pose_differences(poses[:-1], poses[1:]) * 100.0 / shortest_s
    excess = max(
        np.linalg.norm(steps[:, :3], axis=1).max() / speed.velocity,
        np.linalg.norm(steps[:, 3:], axis=1).max() / speed.angular_velocity,
        1.0,
    )
    return _in_time(limits, start, goal, shortest_s * excess)


def plan_fast_motion(
    limits: JointLimits, start: FloatArray, goal: FloatArray, part: float = 1.0
) -> ToolMotion:
    """Return the motion of all joints together to ``goal`` (n,); the tool's speed does not count.

    Arguments: see ``plan_joint_motion``.
    """
    shortest_s = _shortest_s(limits, start, goal, part)
    return _in_time(limits, start, goal, shortest_s) if shortest_s else standing(start)


def _shortest_s(limits: JointLimits, start: FloatArray, goal: FloatArray, part: float) -> float:
    """Return the shortest duration of a motion of the joints; 0: they are there."""
    distance = np.abs(goal - start)
    if distance.max() < 1e-9:
        return 0.0
    return float(
        max(
            (QUINTIC_VELOCITY * distance / (part * limits.velocity)).max(),
            np.sqrt(QUINTIC_ACCELERATION * distance / limits.acceleration).max(),
            2.0 * KNOT_S,
        )
    )


def _in_time(
    limits: JointLimits, start: FloatArray, goal: FloatArray, duration_s: float
) -> ToolMotion:
    displacement = goal - start
    count = int(np.clip(np.ceil(duration_s / KNOT_S), 2, MAX_KNOTS))
    parts = np.linspace(0.0, 1.0, count + 1)
    place = _quintic(parts)
    rate = 30.0 * parts**2 * (1.0 - parts) ** 2 / duration_s
    motion = ToolMotion(
        duration_s * parts,
        start + place[:, None] * displacement,
        rate[:, None] * displacement,
        path_s=duration_s,
    )
    return within_limits(motion, limits)


def _quintic(parts: FloatArray) -> FloatArray:
    """Return shares of the displacement at shares of the time, from rest to rest."""
    place: FloatArray = parts**3 * (10.0 + parts * (6.0 * parts - 15.0))
    return place


def rest_of_lines(
    motion: ToolMotion,
    limits: JointLimits,
    time_s: float,
    kinematics: Kinematics,
    speed: ToolSpeed,
) -> ToolMotion:
    """Return as ``rest_of`` what is left of lines of the tool, with its accelerations kept.

    Arguments: see ``plan_sequence``.
    """
    rest = rest_of(motion, limits, time_s)
    times_s, tool = tool_poses(kinematics, rest)
    factor = tool_excess(times_s, tool, speed)
    bounds = tool_bounds(factor * times_s, tool, speed)
    return replace(rest.slower(factor), rate_bounds=bounds)


def rest_of(motion: ToolMotion, limits: JointLimits, time_s: float) -> ToolMotion:
    """Return what is left of a motion from ``time_s`` on, from rest and on the same path."""
    end_s = motion.duration_s
    if end_s - time_s < FINEST_KNOT_S:
        return ToolMotion(
            np.array([0.0, KNOT_S]),
            np.stack([sampled(motion, np.array([time_s]))[0][0], motion.positions[-1]]),
            np.zeros((2, motion.positions.shape[1])),
            outputs=tuple(
                TimedOutput(KNOT_S, output) for at_s, output in motion.outputs if at_s > time_s
            ),
        )
    # The path's own time passes from 0 to its rate linearly; the area below is half of the ramp.
    ramp_s = min(RAMP_S, end_s - time_s)
    count = max(int(np.ceil(2.0 * ramp_s / FINEST_KNOT_S)), 2)
    since_s = 2.0 * ramp_s * np.arange(count + 1) / count
    passed_s = time_s + since_s**2 / (4.0 * ramp_s)
    rates = since_s / (2.0 * ramp_s)
    later = motion.times_s[motion.times_s > passed_s[-1] + FINEST_KNOT_S]
    times_s = np.concatenate([since_s, later - passed_s[-1] + since_s[-1]])
    passed_s = np.concatenate([passed_s, later])
    rates = np.concatenate([rates, np.ones(len(later))])
    positions, velocities = sampled(motion, passed_s)
    velocities *= rates[:, None]
    if not len(later):
        positions[-1] = motion.positions[-1]
    velocities[-1] = 0.0
    # The inverse of ``passed_s``: a parabola, and after it the time plus that of the ramp.
    outputs = tuple(
        TimedOutput(
            2.0 * float(np.sqrt(ramp_s * left_s)) if left_s < ramp_s else left_s + ramp_s, output
        )
        for left_s, output in ((at_s - time_s, output) for at_s, output in motion.outputs)
        if left_s > 0.0
    )
    rest = ToolMotion(times_s, positions, velocities, path_s=times_s[-1], outputs=outputs)
    return within_limits(rest, limits)


def place_on(motion: ToolMotion, positions: FloatArray, time_s: float, reach_s: float) -> float:
    """Return the time of a motion at which it is nearest to ``positions`` (n,).

    Within ``reach_s`` of ``time_s``.
    """
    for step_s in (CHECK_S, 0.01 * CHECK_S):
        first_s, last_s = max(time_s - reach_s, 0.0), min(time_s + reach_s, motion.duration_s)
        times_s = np.linspace(first_s, last_s, max(int((last_s - first_s) / step_s), 1) + 1)
        away = np.abs(sampled(motion, times_s)[0] - positions).max(axis=1)
        time_s, reach_s = float(times_s[away.argmin()]), CHECK_S
    return time_s


def positions_at(motion: ToolMotion, time_s: float) -> FloatArray:
    """Return the positions (n,) of a motion at one time."""
    found: FloatArray = sampled(motion, np.array([time_s]))[0][0]
    return found


def sampled(motion: ToolMotion, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities, (k, n) each, at times (k,)."""
    index = np.clip(
        np.searchsorted(motion.times_s, times_s, "right") - 1, 0, len(motion.times_s) - 2
    )
    width = (motion.times_s[index + 1] - motion.times_s[index])[:, None]
    part = (times_s - motion.times_s[index])[:, None] / width
    start, end = motion.positions[index], motion.positions[index + 1]
    leave, arrive = motion.velocities[index], motion.velocities[index + 1]
    positions = hermite(part, start, end, width * leave, width * arrive)
    velocities = (
        6.0 * part * (1.0 - part) * (end - start) / width
        + (1.0 - part) * (1.0 - 3.0 * part) * leave
        + part * (3.0 * part - 2.0) * arrive
    )
    return positions, velocities


def standing(start: FloatArray, segments: int = 0) -> ToolMotion:
    """Return a motion that stays at ``start`` (n,)."""
    times_s, still = np.array([0.0, KNOT_S]), np.zeros((2, len(start)))
    return ToolMotion(times_s, np.tile(start, (2, 1)), still, ends_s=(KNOT_S,) * segments)


def knots(joints: Curve, timing: Timing, knot_s: float) -> ToolMotion:
    """Return points of a curve with a timing, at most ``knot_s`` apart."""
    return knots_at(joints, timing, knot_times(timing, knot_s))


def knot_times(timing: Timing, knot_s: float) -> FloatArray:
    """Return times of points, at most ``knot_s`` apart, with one at each rest."""
    # A point at each stop: a cubic from before it to after it would cut the corner.
    parts_s = []
    for begin_s, end_s in pairwise(timing.rests_s):
        count = max(int(np.ceil((end_s - begin_s) / knot_s)), 2)
        parts_s.append(np.linspace(begin_s, end_s, count + 1)[1:])
    return np.concatenate([[0.0], *parts_s])


def knots_at(joints: Curve, timing: Timing, times_s: FloatArray) -> ToolMotion:
    """Return points of a curve with a timing, at times (k,) from its start to its end."""
    at_s, rate = timing.at(times_s)
    at_s[-1], rate[0], rate[-1] = joints.at_s[-1], 0.0, 0.0
    positions, slopes = joints.exact(at_s)
    positions[0] = joints.positions[0]
    return ToolMotion(times_s, positions, slopes * rate[:, None])


def within_limits(motion: ToolMotion, limits: JointLimits) -> ToolMotion:
    """Return the motion, slower where the cubics between the points exceed a limit."""
    return motion.slower(max(limit_excess(motion, limits), 1.0))


def limit_excess(motion: ToolMotion, limits: JointLimits) -> float:
    """Return by how much slower a motion has to be for the limits of the joints; below 1: none."""
    step = np.diff(motion.times_s)[:, None]
    chord = np.diff(motion.positions, axis=0) / step
    first, last = motion.velocities[:-1], motion.velocities[1:]
    # Accelerations at both ends of each cubic; the velocity has its peak between them, or there.
    begin, end = (
        (6.0 * chord - 4.0 * first - 2.0 * last) / step,
        (-6.0 * chord + 2.0 * first + 4.0 * last) / step,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.nan_to_num(begin / (begin - end), nan=0.0)
    turn = np.clip(turn, 0.0, 1.0)
    between = first + step * turn * (begin + 0.5 * turn * (end - begin))
    fastest = np.maximum(np.abs(between).max(axis=0), np.abs(motion.velocities).max(axis=0))
    hardest = np.maximum(np.abs(begin).max(axis=0), np.abs(end).max(axis=0))
    return max(
        float((fastest / limits.velocity).max()),
        float(np.sqrt((hardest / limits.acceleration).max())),
    )


def tool_poses(kinematics: Kinematics, motion: ToolMotion) -> tuple[FloatArray, FloatArray]:
    """Return times (k,), equidistant, and the poses (k, 4, 4) of the tool there."""
    count = int(min(max(motion.duration_s / CHECK_S, 50), MAX_CHECKS))
    times_s = np.linspace(0.0, motion.duration_s, count + 1)
    return times_s, kinematics.forward(sampled(motion, times_s)[0])


def tool_excess(times_s: FloatArray, tool: FloatArray, speed: ToolSpeed) -> float:
    """Return by how much slower the motion has to be for the accelerations of the tool, from 1."""
    _, accelerations = _tool_motion(times_s, tool)
    ratio = max(
        _largest(accelerations[:, :3]) / speed.acceleration,
        _largest(accelerations[:, 3:]) / speed.angular_acceleration,
    )
    return max(float(np.sqrt(ratio)), 1.0)


def tool_bounds(times_s: FloatArray, tool: FloatArray, speed: ToolSpeed) -> RateBounds:
    """Return the bounds of changes of speed at times (k,) with poses (k, 4, 4)."""
    velocities, accelerations = _tool_motion(times_s, tool)
    middle = 0.5 * (velocities[:-1] + velocities[1:]).reshape(-1, 2, 3)
    apart = accelerations.reshape(-1, 2, 3)
    speeds = np.linalg.norm(middle, axis=2)
    along = (middle * apart).sum(axis=2) / np.maximum(speeds, NO_SPEED)
    across = np.sqrt(np.maximum((apart**2).sum(axis=2) - along**2, 0.0))
    at_ends = ((1, 1), (0, 0))  # the first and the last pose have the velocity of one side only
    return RateBounds(
        float(times_s[1]),
        np.pad(speeds, at_ends, "edge"),
        np.pad(along, at_ends, "edge"),
        np.pad(across, at_ends, "edge"),
        np.array([speed.acceleration, speed.angular_acceleration]),
    )


def _tool_motion(times_s: FloatArray, tool: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return velocities (k - 1, 6) between poses (k, 4, 4), and accelerations (k - 2, 6)."""
    step_s = times_s[1]
    velocities = pose_differences(tool[:-1], tool[1:]) / step_s
    return velocities, np.diff(velocities, axis=0) / step_s


def _largest(vectors: FloatArray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())
