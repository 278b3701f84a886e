"""Motion of a tool as a trajectory of the joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robotd.api import FloatArray
from robotd.api.robots import JointLimits, TrajectoryRequest
from robotd_tool_space.joint_path import JointPath, hermite, solve_path
from robotd_tool_space.kinematics import Kinematics, Obstacle, Unreachable
from robotd_tool_space.rotations import pose_differences
from robotd_tool_space.timing import Timing, time_path
from robotd_tool_space.tool_path import ToolPath

KNOT_S = 0.05  # between points of the trajectory
FINEST_KNOT_S = 0.0125
MAX_KNOTS = 2500
CHECK_S = 0.002  # between the times at which the result is checked
MAX_CHECKS = 20_000
LINE_TOLERANCE_M = 1e-4
LINE_TOLERANCE_RAD = np.radians(0.1)
PLANNED_SHARE = 0.5  # of both tolerances: the rest is left to the drives' rounding
ACCELERATION_SHARE = 0.75  # of the joints' limits; cubics between the points have peaks above it
SMOOTH_S = 0.1
QUINTIC_VELOCITY, QUINTIC_ACCELERATION = 1.875, 5.7735  # peaks of d/T and d/T² at rest on both ends


@dataclass(frozen=True)
class ToolSpeed:
    """Limits of the motion of a tool, positive.

    Attributes:
        velocity: m/s.
        angular_velocity: rad/s.
        acceleration: m/s²; the angular one is in the same ratio to the angular velocity.
    """

    velocity: float
    angular_velocity: float
    acceleration: float

    @property
    def acceleration_s(self) -> float:
        """Limit of d²s/dt² of a path whose parameter is the time at full speed, 1/s."""
        return self.acceleration / self.velocity

    def scaled(self, speed: float) -> ToolSpeed:
        """Return the limits at a part of the speed, with the same acceleration."""
        return ToolSpeed(self.velocity * speed, self.angular_velocity * speed, self.acceleration)


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Points of a trajectory.

    Attributes:
        times_s: (k,) from 0.
        positions, velocities: (k, n), rad or m; at rest at both ends.
        deviation_m, deviation_rad: largest distance from the line at any period, planned.
        path_s: duration at full speed of the tool; the joints may make it longer.
    """

    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray
    deviation_m: float = 0.0
    deviation_rad: float = 0.0
    path_s: float = 0.0

    @property
    def duration_s(self) -> float:
        """Time of the last point."""
        return float(self.times_s[-1])

    def request(self, joints: tuple[str, ...]) -> TrajectoryRequest:
        """Return the trajectory that it is, for the n joints by name."""
        return TrajectoryRequest(joints, self.times_s, self.positions, self.velocities)


def plan_lines(
    kinematics: Kinematics,
    limits: JointLimits,
    start: FloatArray,
    poses: Sequence[FloatArray],
    speed: ToolSpeed,
    blend_m: float = 0.0,
) -> ToolMotion:
    """Return the motion of the tool along straight lines through ``poses``.

    A pure function, for a worker thread. The line is kept within 0.1 mm and 0.1° at every period,
    the limits of the joints by a lower speed of the tool.

    Args:
        kinematics: with the tool that moves.
        start: (n,) positions of the joints, at rest.
        poses: (4, 4) each, in the base; the line begins where the tool is.
        speed: of the tool.
        blend_m: see ``ToolPath.through``.

    Raises:
        Unreachable: the line leaves the limits or the reach, or is singular; with the place.
        InvalidArgument: it takes more than an hour, or is too long to be planned at once.
    """
    first = kinematics.forward(start)
    for pose in poses:
        kinematics.require_possible(first, pose)
    path = ToolPath.through([first, *poses], speed.velocity, speed.angular_velocity, blend_m)
    if not path.pieces:
        return _standing(start)
    joints = solve_path(kinematics, path, start)
    timing = time_path(
        joints,
        limits.velocity,
        ACCELERATION_SHARE * limits.acceleration,
        speed.acceleration_s,
        SMOOTH_S,
    )
    knot_s = max(KNOT_S, timing.times_s[-1] / MAX_KNOTS)
    while True:
        motion = _within_limits(_knots(joints, timing, knot_s), limits)
        off_m, off_rad = _deviation(joints, timing, motion)
        if off_m <= PLANNED_SHARE * LINE_TOLERANCE_M and (
            off_rad <= PLANNED_SHARE * LINE_TOLERANCE_RAD
        ):
            return ToolMotion(
                motion.times_s, motion.positions, motion.velocities, off_m, off_rad, path.length_s
            )
        knot_s /= 2.0
        if knot_s < max(FINEST_KNOT_S, timing.times_s[-1] / MAX_KNOTS):
            text = (
                f"the line cannot be kept: {1e3 * off_m:.2f} mm and {np.degrees(off_rad):.2f}° off"
            )
            raise Unreachable(Obstacle.SINGULAR, text)


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
        kinematics, limits, start, speed: see ``plan_lines``.
        goal: positions, rad or m.
        part: 0 to 1 of the joints' speeds.
    """
    way = goal - start
    distance = np.abs(way)
    if distance.max() < 1e-9:
        return _standing(start)
    shortest_s = float(
        max(
            (QUINTIC_VELOCITY * distance / (part * limits.velocity)).max(),
            np.sqrt(QUINTIC_ACCELERATION * distance / limits.acceleration).max(),
            2.0 * KNOT_S,
        )
    )
    parts = np.linspace(0.0, 1.0, 101)
    place = _quintic(parts)
    poses = kinematics.forward(start + place[:, None] * way)
    steps = pose_differences(poses[:-1], poses[1:]) * 100.0 / shortest_s
    excess = max(
        np.linalg.norm(steps[:, :3], axis=1).max() / speed.velocity,
        np.linalg.norm(steps[:, 3:], axis=1).max() / speed.angular_velocity,
        1.0,
    )
    duration_s = shortest_s * excess
    count = int(np.clip(np.ceil(duration_s / KNOT_S), 2, MAX_KNOTS))
    parts = np.linspace(0.0, 1.0, count + 1)
    place = _quintic(parts)
    rate = 30.0 * parts**2 * (1.0 - parts) ** 2 / duration_s
    motion = ToolMotion(
        duration_s * parts, start + place[:, None] * way, rate[:, None] * way, path_s=duration_s
    )
    return _within_limits(motion, limits)


def _quintic(parts: FloatArray) -> FloatArray:
    """Return shares of the way at shares of the time, from rest to rest."""
    place: FloatArray = parts**3 * (10.0 + parts * (6.0 * parts - 15.0))
    return place


def _standing(start: FloatArray) -> ToolMotion:
    return ToolMotion(np.array([0.0, KNOT_S]), np.tile(start, (2, 1)), np.zeros((2, len(start))))


def _knots(joints: JointPath, timing: Timing, knot_s: float) -> ToolMotion:
    # A point at each stop: a cubic from before it to behind it would cut the corner.
    parts_s = []
    for begin_s, end_s in pairwise(timing.rests_s):
        count = max(int(np.ceil((end_s - begin_s) / knot_s)), 2)
        parts_s.append(np.linspace(begin_s, end_s, count + 1)[1:])
    times_s = np.concatenate([[0.0], *parts_s])
    at_s, rate = timing.at(times_s)
    at_s[-1], rate[0], rate[-1] = joints.at_s[-1], 0.0, 0.0
    positions, slopes = joints.exact(at_s)
    positions[0] = joints.positions[0]
    return ToolMotion(times_s, positions, slopes * rate[:, None])


def _within_limits(motion: ToolMotion, limits: JointLimits) -> ToolMotion:
    """Return the motion, slower where the cubics between the points exceed a limit."""
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
    factor = max(
        float((fastest / limits.velocity).max()),
        float(np.sqrt((hardest / limits.acceleration).max())),
        1.0,
    )
    return ToolMotion(
        motion.times_s * factor, motion.positions, motion.velocities / factor, path_s=motion.path_s
    )


def _deviation(joints: JointPath, timing: Timing, motion: ToolMotion) -> tuple[float, float]:
    """Return the largest distance, m and rad, from the pose that the tool should have."""
    factor = motion.duration_s / timing.times_s[-1]
    count = int(min(max(motion.duration_s / CHECK_S, 50), MAX_CHECKS))
    times_s = np.linspace(0.0, motion.duration_s, count + 1)
    index = np.clip(
        np.searchsorted(motion.times_s, times_s, "right") - 1, 0, len(motion.times_s) - 2
    )
    width = (motion.times_s[index + 1] - motion.times_s[index])[:, None]
    positions = hermite(
        (times_s - motion.times_s[index])[:, None] / width,
        motion.positions[index],
        motion.positions[index + 1],
        width * motion.velocities[index],
        width * motion.velocities[index + 1],
    )
    kinematics = joints.kinematics
    wanted = joints.path.poses(np.minimum(timing.at(times_s / factor)[0], joints.at_s[-1]))
    off = pose_differences(kinematics.forward(positions), wanted) @ kinematics.task.chosen.T
    off = off @ kinematics.task.chosen
    return (
        float(np.linalg.norm(off[:, :3], axis=1).max()),
        float(np.linalg.norm(off[:, 3:], axis=1).max()),
    )
