"""Tool of a robot's joint group: its pose, and its motion."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd.api.features import ProcessImage
from robotd.api.robots import TrajectoryRejected, WrenchAxis, WrenchSensor
from robotd_tool_space.geometry.rotations import (
    COMPONENTS,
    checked_components,
    checked_pose,
    inverse_pose,
    pose_of,
    rpy_of,
    turned_twist,
)
from robotd_tool_space.paths.segments import Line, MotionSegment, SequenceStep, check_speed
from robotd_tool_space.paths.tool_motion import ToolMotion, plan_joint_motion
from robotd_tool_space.sequences.motion_queue import MotionQueue
from robotd_tool_space.sequences.planned_tool import Arrival, PlannedTool
from robotd_tool_space.sequences.sequence_parts import SequenceMotion, SequencePart, has_contacts
from robotd_tool_space.sequences.sequence_run import SequenceRun, require_success
from robotd_tool_space.streams.tool_stream import ToolStream
from robotd_tool_space.streams.twist import PoseCommand, ToolTwist, TwistStage

BASE, TOOL = "base", "tool"
AXES = [sign + name for sign in ("", "+", "-") for name in "xyz"]


class RobotTool(PlannedTool):
    """Tool of one joint group: where it is, and motion of it. Any worker thread.

    Poses: the chosen tool in the chosen work frame, matrices (4, 4), m; where no work frame
    is chosen, in the base of the arm. Arguments and errors are those of ``ToolFrames``.
    """

    def measured_pose(self, image: ProcessImage | None = None) -> FloatArray | None:
        """Return the measured pose; None while a position, or a followed frame, is unknown.

        Args:
            image: a copy, which does not change meanwhile; None: the present one.
        """
        positions = (image or self._robot.image.copy()).position[list(self.group.joint_axes)]
        lost = self.followed is not None and self.followed.failure
        if lost or not np.isfinite(positions).all():
            return None
        return inverse_pose(self.work_frame) @ self._kinematics.forward(positions)

    @property
    def pose(self) -> FloatArray:
        """Pose where the joints are commanded to be: that which a move starts from.

        Raises NotReady: not known, as the joints move.
        """
        return inverse_pose(self.work_frame) @ self._kinematics.forward(self.start())

    def pose_with(self, **components: float) -> FloatArray:
        """Return the present pose with some of its components replaced, m and rad."""
        pose = self.pose
        values = dict(zip(COMPONENTS, [*pose[:3, 3], *rpy_of(pose)], strict=True))
        values |= checked_components(components)
        numbers = [float(values[name]) for name in COMPONENTS]
        return pose_of(numbers[:3], numbers[3:])

    def pose_relative(self, frame: str = BASE, **components: float) -> FloatArray:
        """Return the pose at a displacement, m and rad, from the present one.

        Args:
            frame: "base": along the axes of the work frame; "tool": along those of the tool.
            components: 0 where not given.
        """
        numbers = [checked_components(components).get(name, 0.0) for name in COMPONENTS]
        return self.relative(pose_of(numbers[:3], numbers[3:]), frame)

    def relative(self, way: FloatArray, frame: str = BASE) -> FloatArray:
        """Return the present pose moved by ``way`` (4, 4); see ``pose_relative``."""
        if frame not in (BASE, TOOL):
            raise InvalidArgument(f"frame {frame!r} must be {BASE!r} or {TOOL!r}")
        pose, way = self.pose, checked_pose(way, "way")
        if frame == TOOL:
            return pose @ way
        result = np.eye(4)
        result[:3, :3] = way[:3, :3] @ pose[:3, :3]
        result[:3, 3] = pose[:3, 3] + way[:3, 3]
        return result

    def wrench_axis(
        self,
        sensor: WrenchSensor,
        axis: str,
        frame: str = BASE,
        *,
        tool: str | None = None,
        work_frame: str | None = None,
    ) -> WrenchAxis:
        """Return an axis along which a force on the tool counts, for ``WrenchLimits``.

        Args:
            sensor: of the group.
            axis: "x", "y" or "z" for both signs, or one sign, such as "-z".
            frame: "base": the work frame; "tool": the tool.
            tool, work_frame: names; None: those chosen now.

        Raises InvalidArgument: no such axis, frame or name; NotReady: the work frame is followed.
        """
        if axis not in AXES or frame not in (BASE, TOOL):
            raise InvalidArgument(f"axis {axis!r} of {frame!r} must be one of {', '.join(AXES)}")
        at_link, sign = self.at_link, {"+": 1, "-": -1}.get(axis[0], 0)
        own = np.eye(3)["xyz".index(axis[-1])]
        # The sensor is at the link of the tool, or at the one that the last joint moves.
        link = np.eye(3) if sensor.link == self.link else at_link.chain.end[:3, :3]
        if frame == TOOL:
            end = self.kinematics_of(self.tool_name if tool is None else tool).chain.end
            fixed = link @ (inverse_pose(at_link.chain.end) @ end)[:3, :3] @ own
            return WrenchAxis(f"{axis} of the tool", lambda positions: fixed, sign)
        name = self.work_frame_name if work_frame is None else work_frame
        in_base = self.work_frame_of(name)[:3, :3] @ own

        def direction(positions: FloatArray) -> FloatArray:
            turned: FloatArray = link @ (at_link.forward(positions)[:3, :3].T @ in_base)
            return turned

        return WrenchAxis(
            f"{axis} of {f'work frame {name}' if name else 'the base'}", direction, sign
        )

    def inverse(self, pose: FloatArray, seed: FloatArray | None = None) -> FloatArray:
        """Return joint positions (n,) of a pose; ``seed`` None: from where the joints are.

        Raises Unreachable.
        """
        target = self.work_frame @ checked_pose(pose)
        return self._kinematics.inverse(target, self.start() if seed is None else seed)

    def plan_move(self, pose: FloatArray, speed: float = 1.0) -> ToolMotion:
        """Return the motion to a pose, in which all joints move directly to their goals.

        Of the solutions that can be executed, without a collision where these are checked, that is
        taken which the joints reach first. Where none can, the first is returned: executing it
        raises the reason.

        Args:
            pose: goal.
            speed: 0.01 to 1 of the speeds of joints and tool.

        Raises Unreachable, InvalidArgument, NotReady.
        """
        check_speed(speed)
        start = self.start()
        target = self.fixed_work_frame @ checked_pose(pose)
        goals = self._kinematics.solutions(target, start)
        for goal in goals:
            motion = self._plan_joints(start, goal, speed)
            with suppress(TrajectoryRejected):
                self.group.follower.check(motion.request(self.group.joint_names))
                return motion
        return self._plan_joints(start, goals[0], speed)

    def plan_joints(self, goal: FloatArray, speed: float = 1.0) -> ToolMotion:
        """Return the motion of all joints together to positions (n,), rad or m.

        Raises InvalidArgument, NotReady; a goal beyond the limits is rejected when it is executed.
        """
        check_speed(speed)
        return self._plan_joints(self.start(), goal, speed)

    def _plan_joints(self, start: FloatArray, goal: FloatArray, speed: float) -> ToolMotion:
        limits, tool = self.group.follower.limits, self.speed.scaled(speed)
        with self._noted():
            return plan_joint_motion(self._kinematics, limits, start, goal, tool, speed)

    def plan_lines(
        self, poses: Sequence[FloatArray], speed: float = 1.0, blend_m: float = 0.0
    ) -> ToolMotion:
        """Return the motion along straight lines through ``poses``.

        Args:
            poses: at least one.
            speed: 0.01 to 1 of the speed of the tool.
            blend_m: distance from an inner pose at which the corner is rounded; 0: stops there.

        Raises Unreachable: with the place; InvalidArgument, NotReady.
        """
        if not poses:
            raise InvalidArgument("a line needs a pose")
        return self.plan_sequence([Line(pose, speed=speed, blend_m=blend_m) for pose in poses])

    def plan_sequence(
        self, segments: Sequence[MotionSegment], *, constant_speed: bool = False
    ) -> ToolMotion:
        """Return the motion along segments, planned whole.

        Args:
            segments: at least one; their poses are in the chosen work frame.
            constant_speed: the tool keeps one speed between two stops, except at their ends: the
                highest that is possible all the way, at most that of the slowest segment.

        Raises Unreachable: with segment and place; InvalidArgument, NotReady.
        """
        if not segments:
            raise InvalidArgument("a sequence needs a segment")
        if has_contacts(segments):
            raise InvalidArgument("a segment with until belongs to move_sequence")
        in_base = [segment.in_base(self.fixed_work_frame) for segment in segments]
        plan, start = self._planner(constant_speed=constant_speed), self.start()
        with self._noted():
            return plan(start, in_base, None)

    def move_to(self, pose: FloatArray, speed: float = 1.0) -> None:
        """Move to a pose, and return when the tool is there. Arguments: see ``plan_move``.

        Raises Unreachable, InvalidArgument, NotReady: nothing has moved; OperationError: the
        motion ended elsewhere, with the reason.
        """
        arrival = self.arrive()
        self.execute(self.plan_move(pose, speed), arrival)

    def move_line(self, *poses: FloatArray, speed: float = 1.0, blend_m: float = 0.0) -> None:
        """Move along straight lines through ``poses``, and return when the tool is there.

        Arguments: see ``plan_lines``; errors: see ``move_to``.
        """
        arrival = self.arrive()
        self.execute(self.plan_lines(poses, speed, blend_m), arrival)

    def move_sequence(self, *steps: SequenceStep, constant_speed: bool = False) -> None:
        """Move along segments, with waits between them, and return when the tool is at their end.

        Arguments: see ``plan_sequence``; errors: see ``move_to``.
        """
        require_success(*self._begin(steps, constant_speed).run())

    def sequence(self, parts: Sequence[SequencePart], arrival: Arrival) -> SequenceRun:
        """Return the execution of a sequence, checked whole. Arguments, errors: of the class."""
        with self._noted():
            return SequenceRun(self._robot, self, parts, arrival)

    def queue(self) -> MotionQueue:
        """Return an empty queue of segments, as a context."""
        return MotionQueue(self._begin)

    def _begin(self, steps: Sequence[SequenceStep], constant_speed: bool = False) -> SequenceRun:
        arrival = self.arrive()  # before the planning: a stop meanwhile ends the motion
        return self.sequence(self.plan_parts(steps, constant_speed=constant_speed), arrival)

    def execute(self, motion: ToolMotion, arrival: Arrival | None = None) -> None:
        """Execute a planned motion as ``follow``, and set its outputs on the way.

        Raises OperationError: it ended elsewhere; or, of an output, its error, which stops the arm.
        """
        run = self.sequence([SequenceMotion(0, (), motion)], arrival or self.arrive())
        require_success(*run.run())

    def stream(self, **options: Any) -> ToolStream:
        """Return an open stream of twists; ``options`` and errors are those of ``JointStreams``."""
        _ = self._kinematics.task  # takes a while: not in the control loop
        stage = TwistStage(lambda: self._kinematics, self.group.motion_limits)
        return ToolStream(self.group.stream(**options), stage, self)

    def twist_in_work_frame(self, twist: FloatArray) -> ToolTwist:
        """Return the command of a velocity (6,) in the chosen work frame, and with a followed one.

        Raises NotReady: that is not followed any more.
        """
        if (followed := self.followed) is None:
            return ToolTwist(turned_twist(self.work_frame[:3, :3], twist))
        followed.require()
        return ToolTwist(twist, frame=followed)

    def target_in_work_frame(self, pose: FloatArray) -> PoseCommand:
        """Return the command of a pose, see ``twist_in_work_frame``."""
        if (followed := self.followed) is None:
            return PoseCommand(self.work_frame @ pose)
        followed.require()
        return PoseCommand(pose, followed)
