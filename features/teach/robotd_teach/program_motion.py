"""Motion of the steps of a program: where each leads from where the arm is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import numpy as np

from robotd.api import (
    DescriptorError,
    FloatArray,
    InvalidArgument,
    NotReady,
    Unsupported,
    unknown_name,
)
from robotd.api.robots import ContactLimits, Robot, WrenchLimits
from robotd_teach.io_names import bit_of
from robotd_teach.joint_groups import beyond_limits, commands_at_rest, joint_group
from robotd_teach.path_curve import PathCurve
from robotd_teach.path_file import PathFile
from robotd_teach.path_motion import require_at_start
from robotd_teach.paths import Paths
from robotd_teach.program_file import (
    MoveOnArc,
    MoveOnSpline,
    MoveToPose,
    OutputOnPath,
    Path_,
    ProgramFile,
    Step,
    Target,
)
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import COMPONENTS, inverse_pose, pose_of, rpy_of
from robotd_tool_space.paths.path_outputs import PathOutput
from robotd_tool_space.paths.segments import Arc, ArcAbout, JointMove, Line, MotionSegment, Spline
from robotd_tool_space.paths.tool_motion import (
    ToolMotion,
    plan_fast_motion,
    rest_of,
    rest_of_lines,
)
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.sequences.sequence_plan import plan_sequence, trace_sequence
from robotd_tool_space.tool_groups import ToolGroups

TOOL = "the tool"
SAMPLE_RAD = 0.02  # between two positions of a move that are checked for collisions, rad or m

JointsByName = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Place:
    """State of the arm between two steps.

    Attributes:
        positions: (n,) of the joints, rad or m; None: not known.
        tool: name of the chosen tool, "" for the link itself.
        work_frame: name of the chosen work frame, "" for the base.
    """

    positions: FloatArray | None
    tool: str = ""
    work_frame: str = ""


class Distance(NamedTuple):
    """Distance between two places: of the tool, or of the joint that is farthest from its own.

    Attributes:
        what: "the tool", or the name of the joint.
        value: in ``unit``: m, or rad.
    """

    what: str
    value: float
    unit: str

    def __str__(self) -> str:
        """Return ``the tool 0.21 mm`` or ``joint1 0.0012 rad``."""
        if self.what == TOOL:
            return f"{self.what} {1e3 * self.value:.2f} mm"
        return f"{self.what} {self.value:.4f} {self.unit}"


class StepPlanner:
    """Plans the motion of steps of a program with one joint group. Any worker thread.

    Args:
        robot: that moves.
        file: the program's.
        taught: poses of the robot by name.
        paths: recorded ones by name, as far as the program plays them.
        problems: why the arm cannot go to taught poses, by their name; "": it can.

    Attributes:
        group: joint group that moves.
        tool: of the group; None: it has none, for ``reason``.

    Raises InvalidArgument: no such joint group, or several and none is named.
    """

    def __init__(
        self,
        robot: Robot,
        file: ProgramFile,
        taught: Mapping[str, JointsByName],
        paths: Mapping[str, PathFile],
        problems: Mapping[str, str],
    ) -> None:
        self._robot, self._file, self._taught, self._paths = robot, file, taught, paths
        self._problems = problems
        self.group = joint_group(robot, file.group)
        self.tool: RobotTool | None = None
        self.reason = ""
        try:
            self.tool = robot.feature(ToolGroups).of(self.group.name)
        except (DescriptorError, Unsupported, InvalidArgument) as error:
            self.reason = str(error)

    def here(self) -> Place:
        """Return where the arm rests. Raises NotReady: it moves, or that is not known."""
        positions = commands_at_rest(self._robot, self.group)
        if self.tool is None:
            return Place(positions)
        return Place(positions, self.tool.tool_name, self.tool.work_frame_name)

    def plan(self, step: Step, place: Place) -> ToolMotion:
        """Return the motion of a step. Raises InvalidArgument, Unsupported: the reason."""
        start, limits = self._start(place), self.group.follower.limits
        if step.move is not None:
            return plan_fast_motion(limits, start, self._goal(step.move, place), self._speed(step))
        if step.path is not None and step.path.name is not None:
            curve = self._recorded(step.path, step.path.name, start)
            return step.path.playback(self._file.speed).plan(curve, limits, start).motion
        kinematics, segments = self._segments(step, place)
        constant = step.sequence is not None and step.sequence.constant_speed
        speed = self.need_tool().speed
        return plan_sequence(kinematics, limits, start, segments, speed, constant_speed=constant)

    def rest(self, step: Step, place: Place, motion: ToolMotion, time_s: float) -> ToolMotion:
        """Return what is left of the motion of a step from ``time_s`` on, from rest."""
        limits = self.group.follower.limits
        if not step.needs_tool:
            return rest_of(motion, limits, time_s)
        tool = self.need_tool()
        speed = tool.speed.scaled(self._speed(step))
        return rest_of_lines(motion, limits, time_s, tool.kinematics_of(place.tool), speed)

    def trace(self, step: Step, place: Place) -> FloatArray:
        """Return positions (k, n) along the path of a step: as ``plan``, in a part of its time.

        Raises InvalidArgument, Unsupported: the reason why it cannot be executed.
        """
        start = self._start(place)
        if step.move is not None:
            goal = self._goal(step.move, place)
            return _straight(start, goal)
        if step.path is not None and step.path.name is not None:
            places = self._recorded(step.path, step.path.name, start).positions
            return np.vstack([_straight(start, places[0]), places])
        kinematics, segments = self._segments(step, place)
        limits, speed = self.group.follower.limits, self.need_tool().speed
        displacement = trace_sequence(kinematics, limits, start, segments, speed)
        self._require_within(displacement[-1])
        return displacement

    def contact(self, step: Step, place: Place) -> ContactLimits | WrenchLimits | None:
        """Return the torques or the wrench at which a step ends; None: at its target only.

        Args:
            place: whose tool and work frame are those of the axis of a wrench.

        Raises InvalidArgument: unknown joint; Unsupported: no wrench at the tool, or no tool;
        NotReady: torque or wrench are not known, or the work frame moves.
        """
        motion = step.move or step.line
        if motion is None or motion.until is None:
            return None
        until = motion.until
        if until.torque is not None:
            return self._torques(until.torque)
        sensor = self._robot.wrenches.of(self.group.name)
        sensor.require()
        axis = None
        if until.axis is not None:
            names = {"tool": place.tool, "work_frame": place.work_frame}
            frame = until.frame or "base"
            axis = self.need_tool().wrench_axis(sensor, until.axis, frame, **names)
        bias = until.bias is not False
        return WrenchLimits(sensor, until.force_n or inf, until.torque_nm or inf, bias, axis)

    def _torques(self, wanted: float | Mapping[str, float]) -> ContactLimits:
        names = list(self.group.joint_names)
        torque = np.full(len(names), inf if isinstance(wanted, Mapping) else wanted)
        for name, limit in wanted.items() if isinstance(wanted, Mapping) else ():
            if name not in names:
                raise InvalidArgument(unknown_name("joint", name, names))
            torque[names.index(name)] = limit
        contact = ContactLimits(torque)
        measured = self._robot.image.copy().torque[list(self.group.joint_axes)]
        contact.require_torques(self.group.follower.limits, measured)
        return contact

    def distance_between(self, first: FloatArray, last: FloatArray) -> Distance:
        """Return how far the tool, or a joint, is from one to another of positions (n,)."""
        if self.tool is not None:
            kinematics = self.tool.kinematics_of(self.tool.tool_name)
            ends = (kinematics.forward(positions)[:3, 3] for positions in (first, last))
            return Distance(TOOL, float(np.linalg.norm(np.subtract(*ends))), "m")
        limits, distances = self.group.follower.limits, np.abs(last - first)
        joint = int(distances.argmax())
        return Distance(limits.names[joint], float(distances[joint]), limits.units[joint])

    def need_tool(self) -> RobotTool:
        """Return the tool. Raises Unsupported: the group has none."""
        if self.tool is None:
            raise Unsupported(self.reason)
        return self.tool

    def positions_of(self, name: str) -> FloatArray:
        """Return the positions (n,) of a pose by its name.

        Raises InvalidArgument: there is none, it is of other joints, or the arm cannot go there.
        """
        poses = {**self._taught, **self._file.poses}
        if name not in poses:
            raise InvalidArgument(unknown_name("pose", name, poses))
        if name not in self._file.poses and (problem := self._problems.get(name, "")):
            raise InvalidArgument(f"pose {name} cannot be gone to: {problem}")
        return self.checked_pose(f"pose {name}", poses[name])

    def checked_pose(self, what: str, joints: JointsByName) -> FloatArray:
        """Return positions by name as (n,). Raises InvalidArgument: not those of the group."""
        own = self.group.joint_names
        if joints.keys() != set(own):
            wrong = [name for name in joints if name not in own]
            text = f"{what}: no joint {wrong[0]}" if wrong else f"{what}: not all joints"
            raise InvalidArgument(f"{text} (joints of the group: {', '.join(own)})")
        return np.array([float(joints[name]) for name in own])

    def _recorded(self, step: Path_, name: str, start: FloatArray) -> PathCurve:
        """Return the curve of a recorded path. Raises InvalidArgument: it cannot be played here."""
        if name not in self._paths:
            raise InvalidArgument(unknown_name("path", name, self._robot.feature(Paths).all()))
        path, limits = self._paths[name], self.group.follower.limits
        if problem := self._robot.feature(Paths).problem(path):
            raise InvalidArgument(f"path {name} cannot be played: {problem}")
        self.checked_pose(f"path {name}", dict.fromkeys(path.joints, 0.0))
        curve = step.playback(self._file.speed).curve(path, limits)
        if not step.approach:
            require_at_start(limits, start, curve.positions[0])
        return curve

    def _start(self, place: Place) -> FloatArray:
        if place.positions is None:
            raise NotReady("the positions of the joints are not known")
        return place.positions

    def _speed(self, step: Step) -> float:
        speed: float | None = step.value.speed
        return self._file.speed if speed is None else speed

    def _goal(self, target: Target, place: Place) -> FloatArray:
        """Return the positions (n,) of a target."""
        start = self._start(place)
        goal = self._joint_goal(target, start)
        if goal is None:
            kinematics = self.need_tool().kinematics_of(place.tool)
            pose = self._pose(target, kinematics.forward(start), kinematics, place)
            goal = kinematics.inverse(pose, start)
        self._require_within(goal)
        return goal

    def _joint_goal(self, target: Target, start: FloatArray) -> FloatArray | None:
        """Return the positions of a pose or of joints; None: the target is one of the tool."""
        if target.pose is not None:
            return self.positions_of(target.pose)
        if target.joints is None:
            return None
        names, goal = list(self.group.joint_names), start.copy()
        for name, position in target.joints.items():
            if name not in names:
                raise InvalidArgument(unknown_name("joint", name, names))
            goal[names.index(name)] = position
        return goal

    def _require_within(self, goal: FloatArray) -> None:
        if text := beyond_limits(self.group.follower.limits, goal):
            raise InvalidArgument(text)

    def _segments(self, step: Step, place: Place) -> tuple[Kinematics, list[MotionSegment]]:
        """Return the segments of a motion of the tool, with poses in the base."""
        kinematics = self.need_tool().kinematics_of(place.tool)
        pose = kinematics.forward(self._start(place))
        segments: list[MotionSegment] = []
        for part in _parts(step):
            segment, pose = self._segment(part, pose, kinematics, place)
            of_part = self._speed(step) if part.speed is None else part.speed
            segments.append(
                replace(
                    segment,
                    speed=of_part,
                    blend_m=part.blend_m,
                    blend_rad=part.blend_rad,
                    outputs=tuple(map(self._output, part.outputs)),
                )
            )
        return kinematics, segments

    def _output(self, output: OutputOnPath) -> PathOutput:
        io = self._robot.io
        bit = bit_of("output", output.name, io.outputs, io.sizes[1])
        return PathOutput(*bit, output.on, output.at_m, output.at_s)

    def _segment(
        self, part: _Part, before: FloatArray, kinematics: Kinematics, place: Place
    ) -> tuple[MotionSegment, FloatArray]:
        """Return a segment, and the pose where it ends; ``before``: where it begins."""

        def pose(target: Target, before: FloatArray = before) -> FloatArray:
            if part.in_sequence and target.joints is not None:
                self.checked_pose("joints in a sequence", target.joints)  # all: none stays
            return self._pose(target, before, kinematics, place)

        move = part.motion
        if isinstance(move, MoveToPose):
            end = pose(move)
            goal = self._joint_goal(move, self._start(place))
            return JointMove(end if goal is None else goal), end
        if isinstance(move, MoveOnSpline):
            poses = [before]
            for target in move.through:
                poses.append(pose(target, poses[-1]))
            return Spline(poses[1:]), poses[-1]
        if isinstance(move, Target):
            end = pose(move)
            return Line(end), end
        if move.via is not None and move.to is not None:
            end = pose(move.to)
            return Arc(pose(move.via), end), end
        if move.centre is None or move.angle is None:
            raise InvalidArgument("an arc needs via and to, or centre and angle")
        arc = ArcAbout(pose(move.centre), move.angle, turns=move.turns is not False)
        return arc, arc.end(before)

    def _pose(
        self, target: Target, before: FloatArray, kinematics: Kinematics, place: Place
    ) -> FloatArray:
        """Return the pose of a target in the base; ``before``: where the tool is, in the base."""
        joints = self._joint_goal(target, self._start(place))
        if joints is not None:
            return kinematics.forward(joints)
        work_frame = self.need_tool().work_frame_of(place.work_frame)
        pose = inverse_pose(work_frame) @ before
        if target.at is not None:
            present = dict(zip(COMPONENTS, [*pose[:3, 3], *rpy_of(pose)], strict=True))
            return work_frame @ _pose_of({**present, **target.at.given})
        given = target.by.given if target.by is not None else {}
        displacement = _pose_of({**dict.fromkeys(COMPONENTS, 0.0), **given})
        if target.frame == "tool":
            return before @ displacement
        moved = np.eye(4)
        moved[:3, :3] = displacement[:3, :3] @ pose[:3, :3]
        moved[:3, 3] = pose[:3, 3] + displacement[:3, 3]
        return work_frame @ moved


class _Part(NamedTuple):
    """Motion within a step."""

    motion: Target | MoveOnArc | MoveOnSpline
    speed: float | None
    blend_m: float = 0.0
    blend_rad: float | None = None
    outputs: Sequence[OutputOnPath] = ()
    in_sequence: bool = False


def _parts(step: Step) -> list[_Part]:
    if step.line is not None:
        return [_Part(step.line, step.line.speed)]
    if step.arc is not None:
        return [_Part(step.arc, step.arc.speed)]
    if step.path is not None and step.path.through is not None:
        blend_m = step.path.blend_m or 0.0
        return [_Part(target, step.path.speed, blend_m) for target in step.path.through]
    if step.sequence is None:
        raise InvalidArgument(f"{step.kind} is not a motion of the tool")
    whole, parts = step.sequence, []
    for segment in whole.segments:
        motion = segment.move or segment.line or segment.arc or segment.spline
        if motion is None:
            raise InvalidArgument("a segment needs a motion")
        blend_m = whole.blend_m if segment.blend_m is None else segment.blend_m
        blend_rad = whole.blend_rad if segment.blend_rad is None else segment.blend_rad
        part = _Part(motion, motion.speed, blend_m, blend_rad, segment.outputs, in_sequence=True)
        parts.append(part)
    return parts


def _straight(start: FloatArray, goal: FloatArray) -> FloatArray:
    """Return positions (k, n) from one place to another."""
    count = int(np.ceil(np.abs(goal - start).max() / SAMPLE_RAD)) + 1
    return np.linspace(start, goal, count + 1)


def _pose_of(values: Mapping[str, float]) -> FloatArray:
    numbers = [float(values[name]) for name in COMPONENTS]
    return pose_of(numbers[:3], numbers[3:])
