"""Plan of one motion of many segments: its route, its timing, and the trajectory of the joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd.api.robots import JointLimits
from robotd_tool_space.geometry.kinematics import Kinematics, Unreachable, UnreachableCause
from robotd_tool_space.geometry.rotations import pose_differences
from robotd_tool_space.paths.joint_path import solve_at_once
from robotd_tool_space.paths.joint_route import EvenRoute, JointCurve, JointLine, Route
from robotd_tool_space.paths.path_outputs import TimedOutput
from robotd_tool_space.paths.segments import JointMove, MotionSegment, ToolSegment
from robotd_tool_space.paths.timing import Timing, time_route
from robotd_tool_space.paths.tool_curves import ToolCurve, ToolSpeed
from robotd_tool_space.paths.tool_motion import (
    ACCELERATION_SHARE,
    FINEST_KNOT_S,
    KNOT_S,
    MAX_KNOTS,
    SMOOTH_S,
    ToolMotion,
    knots,
    standing,
    tool_bounds,
    tool_excess,
    tool_poses,
    within_limits,
)
from robotd_tool_space.paths.tool_path import NO_LENGTH_S, Blend, ToolPath

LINE_TOLERANCE_M = 1e-4
LINE_TOLERANCE_RAD = np.radians(0.1)
SAME_M = 1e-6
PLANNED_SHARE = 0.5  # of both tolerances: the rest is left to the drives' rounding


def plan_sequence(
    kinematics: Kinematics,
    limits: JointLimits,
    start: FloatArray,
    segments: Sequence[MotionSegment],
    speed: ToolSpeed,
    *,
    constant_speed: bool = False,
    first: int | None = None,
) -> ToolMotion:
    """Return the motion along segments, one after the other.

    A pure function, for a worker thread. The curve of the tool is kept within 0.1 mm and 0.1° at
    every period, the accelerations of the tool and the limits of the joints by a lower speed.

    Args:
        kinematics: with the tool that moves.
        start: (n,) positions of the joints, at rest.
        segments: with poses in the base; the first begins where the tool is.
        speed: of the tool; that of each segment is a part of it.
        constant_speed: the tool keeps one speed between two stops, except at their ends.
        first: number of segments of the sequence that come before, for messages; None: these are
            all, and a single one has no number.

    Raises:
        Unreachable: a segment leaves the limits or the reach, or is singular; with the place.
        InvalidArgument: a value of a segment is out of its bounds, the motion takes more than an
            hour or is too long to be planned at once, or the constant speed cannot be kept.
    """
    planned = _built(kinematics, limits, start, segments, speed, first).route(len(segments))
    if planned is None:
        return standing(start, len(segments))
    route: Route | EvenRoute = planned
    if constant_speed:
        speed = speed.scaled(min(segment.speed for segment in segments))
        route = EvenRoute.of(planned, kinematics, speed.velocity)
    of_joints = limits.velocity, ACCELERATION_SHARE * limits.acceleration
    timing = time_route(route, kinematics, of_joints, speed, SMOOTH_S)
    motion = _kept(route, timing, kinematics, limits, speed)
    names = _names(segments, first)
    outputs = tuple(_outputs(motion, kinematics, segments, names))
    notes = tuple(_notes(planned, segments, names))
    return replace(motion, path_s=float(route.at_s[-1]), notes=notes, outputs=outputs)


def trace_sequence(
    kinematics: Kinematics,
    limits: JointLimits,
    start: FloatArray,
    segments: Sequence[MotionSegment],
    speed: ToolSpeed,
) -> FloatArray:
    """Return joint positions (k, n) along segments, without times: faster than ``plan_sequence``.

    Raises Unreachable, InvalidArgument.
    """
    return _built(kinematics, limits, start, segments, speed).positions(len(segments))


def _built(
    kinematics: Kinematics,
    limits: JointLimits,
    start: FloatArray,
    segments: Sequence[MotionSegment],
    speed: ToolSpeed,
    first: int | None = None,
) -> _RouteBuilder:
    builder = _RouteBuilder(kinematics, limits.velocity, start, speed)
    is_named = len(segments) > 1 or first is not None
    for number, (segment, text) in enumerate(zip(segments, _names(segments, first), strict=True)):
        name = text if is_named else ""
        try:
            segment.check()
            builder.add(number, segment, name)
        except Unreachable as error:
            raise _named(error, name) from None
        except InvalidArgument as error:
            raise InvalidArgument(f"{name}: {error}" if name else str(error)) from None
    return builder


def _names(segments: Sequence[MotionSegment], first: int | None) -> list[str]:
    """Return the names of segments in messages."""
    numbered = enumerate(segments, (first or 0) + 1)
    return [f"segment {number}, {segment.kind}" for number, segment in numbered]


class _CurveBehind(NamedTuple):
    """Curve of the tool, with the name of its segment and the blend of the corner before it."""

    name: str
    curve: ToolCurve
    blend: Blend


class _RouteBuilder:
    """Builds a route: successive curves of the tool become one path, which is solved at once."""

    def __init__(
        self,
        kinematics: Kinematics,
        velocity: FloatArray,
        start: FloatArray,
        speed: ToolSpeed,
    ) -> None:
        self._kinematics, self._velocity = kinematics, velocity
        self._speed = speed
        self._here, self._pose = start, kinematics.forward(start)
        self._curves: list[JointCurve] = []
        self._blends: list[Blend] = []
        self._path: list[_CurveBehind] = []
        self._numbers: list[int] = []  # of the segments that have a length
        self._blend = Blend()

    def add(self, number: int, segment: MotionSegment, name: str) -> None:
        """Append a segment. Raises Unreachable, InvalidArgument."""
        kinematics = self._kinematics
        speed = self._speed.scaled(segment.speed)
        if isinstance(segment, ToolSegment):
            curve = segment.curve(kinematics, self._pose, speed)
            if curve.length_s <= NO_LENGTH_S:
                return
            self._path.append(_CurveBehind(name, curve, self._blend))
            (self._pose,) = curve.poses(np.array([curve.length_s]))
        elif isinstance(segment, JointMove):
            self._solve_path()
            goal = segment.goal(kinematics, self._here)
            velocity = segment.speed * self._velocity
            line = JointLine.to(kinematics, self._here, goal, velocity, speed)
            if line.length_s <= NO_LENGTH_S:
                return
            self._append(line, self._blend)
            self._here, self._pose = goal, kinematics.forward(goal)
        self._numbers.append(number)
        self._blend = segment.blend(self._speed)

    def route(self, count: int) -> Route | None:
        """Return the route of ``count`` segments. Raises Unreachable, InvalidArgument."""
        self._solve_path()
        if not self._curves:
            return None
        route = Route.of(self._kinematics, self._curves, self._blends)
        # A segment without a length ends where the one before does.
        ends = dict(zip(self._numbers, route.ends_s, strict=True))
        ends_s, passed_s = [], 0.0
        for number in range(count):
            passed_s = ends.get(number, passed_s)
            ends_s.append(passed_s)
        return replace(route, ends_s=tuple(ends_s))

    def positions(self, count: int) -> FloatArray:
        """Return positions (k, n) along the route. Raises Unreachable, InvalidArgument."""
        self._solve_path()
        if len(self._curves) == 1:  # without a corner between two: no need of its derivatives
            return self._curves[0].positions
        route = self.route(count)
        return self._here[None] if route is None else route.positions

    def _append(self, curve: JointCurve, blend: Blend) -> None:
        if self._curves:
            self._blends.append(blend)
        self._curves.append(curve)

    def _solve_path(self) -> None:
        if not self._path:
            return
        curves = [piece.curve for piece in self._path]
        path = ToolPath.of(curves, [piece.blend for piece in self._path[1:]])
        try:
            solved = solve_at_once(self._kinematics, path, self._here)
        except Unreachable as error:
            raise self._placed(error, path) from None
        self._append(solved, self._path[0].blend)
        self._here = solved.positions[-1]
        self._path = []

    def _placed(self, error: Unreachable, path: ToolPath) -> Unreachable:
        """Return an error with its segment, and the place on that."""
        at_s = (error.place or 0.0) * path.length_s
        index = min(int(np.searchsorted(path.ends_s, at_s)), len(self._path) - 1)
        edges_s = (0.0, *path.ends_s)
        length_s = edges_s[index + 1] - edges_s[index]
        part = min(max((at_s - edges_s[index]) / length_s, 0.0), 1.0)
        return _named(Unreachable(error.cause, error.text, part), self._path[index].name)


def _named(error: Unreachable, name: str) -> Unreachable:
    """Return an error with the name of its segment; "": there is only one."""
    if not name or str(error).startswith("segment "):
        return error
    named = Unreachable(error.cause, f"{name}: {error}")
    named.text, named.place = error.text, error.place
    return named


def _kept(
    route: Route | EvenRoute,
    timing: Timing,
    kinematics: Kinematics,
    limits: JointLimits,
    speed: ToolSpeed,
) -> ToolMotion:
    """Return the motion that keeps a route, with as many points as that takes."""
    knot_s = max(KNOT_S, timing.times_s[-1] / MAX_KNOTS)
    while True:
        motion = within_limits(knots(route, timing, knot_s), limits)
        times_s, tool = tool_poses(kinematics, motion)
        off_m, off_rad = _deviation(route, timing, kinematics, times_s, tool)
        if off_m <= PLANNED_SHARE * LINE_TOLERANCE_M and (
            off_rad <= PLANNED_SHARE * LINE_TOLERANCE_RAD
        ):
            factor = tool_excess(times_s, tool, speed)
            ends_s = np.interp(route.ends_s, timing.at_s, timing.times_s)
            return replace(
                motion.slower(factor),
                deviation_m=off_m,
                deviation_rad=off_rad,
                rate_bounds=tool_bounds(factor * times_s, tool, speed),
                ends_s=tuple((ends_s * (factor * times_s[-1] / timing.times_s[-1])).tolist()),
            )
        knot_s /= 2.0
        if knot_s < max(FINEST_KNOT_S, timing.times_s[-1] / MAX_KNOTS):
            text = (
                f"the line cannot be kept: {1e3 * off_m:.2f} mm and {np.degrees(off_rad):.2f}° off"
            )
            raise Unreachable(UnreachableCause.SINGULAR, text)


def _deviation(
    route: Route | EvenRoute,
    timing: Timing,
    kinematics: Kinematics,
    times_s: FloatArray,
    tool: FloatArray,
) -> tuple[float, float]:
    """Return the largest distance, m and rad, from the pose that the tool should have."""
    task, part = kinematics.task, timing.times_s[-1] / times_s[-1]
    wanted = route.poses(np.minimum(timing.at(times_s * part)[0], route.at_s[-1]))
    off = pose_differences(tool, wanted) @ task.chosen.T @ task.chosen
    linear, angular = np.linalg.norm(off.reshape(-1, 2, 3), axis=2).max(axis=0)
    return float(linear), float(angular)


def _outputs(
    motion: ToolMotion,
    kinematics: Kinematics,
    segments: Sequence[MotionSegment],
    names: Sequence[str],
) -> Iterator[TimedOutput]:
    """Yield the outputs of all segments. Raises InvalidArgument: one is beside the path."""
    if not any(segment.outputs for segment in segments):
        return
    times_s, tool = tool_poses(kinematics, motion)
    steps = np.linalg.norm(np.diff(tool[:, :3, 3], axis=0), axis=1)
    distances = np.concatenate([[0.0], np.cumsum(steps)])
    for name, segment, end_s in zip(names, segments, motion.ends_s, strict=True):
        for output in segment.outputs:
            distance, time_s = float(np.interp(end_s, times_s, distances)) + output.at_m, end_s
            if output.at_m:
                time_s = float(np.interp(distance, distances, times_s))
            time_s += output.at_s
            if not (
                0.0 <= time_s <= motion.duration_s and -SAME_M <= distance <= distances[-1] + SAME_M
            ):
                raise InvalidArgument(
                    f"{name}: output {output.byte}.{output.bit} at"
                    f" {output.at_m:g} m and {output.at_s:g} s from its end is not on the path"
                )
            yield TimedOutput(time_s, output)


def _notes(route: Route, segments: Sequence[MotionSegment], names: Sequence[str]) -> Iterator[str]:
    """Yield what is not as it was asked for: corners that are stops."""
    rests_s = route.at_s[list(route.rests)]
    for name, segment, end_s in zip(names, segments[:-1], route.ends_s, strict=False):
        asked = segment.blend_m > 0.0 or (segment.blend_rad or 0.0) > 0.0
        if asked and len(rests_s) and np.abs(rests_s - end_s).min() < NO_LENGTH_S:
            turn = "" if segment.blend_rad is None else f" and {segment.blend_rad:g} rad"
            yield (
                f"{name}, ends at rest: no corner to the next one is"
                f" within {segment.blend_m:g} m{turn}"
            )
