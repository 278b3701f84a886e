"""Tool of a robot's joint group: its pose, and its motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from robotd.api import (
    FloatArray,
    InvalidArgument,
    NotReady,
    RobotdError,
    Unsupported,
    wait_until,
)
from robotd.api.features import EventKind, Level, ProcessImage
from robotd.api.robots import Interruption, TrajectoryExecution, TrajectoryRejected
from robotd_tool_space.motion_join import JoinedMotion, join
from robotd_tool_space.motion_queue import MotionQueue
from robotd_tool_space.rotations import (
    COMPONENTS,
    checked_components,
    checked_pose,
    inverse_pose,
    pose_of,
    rpy_of,
)
from robotd_tool_space.segments import Line, MotionSegment, SequenceStep, check_speed
from robotd_tool_space.sequence_parts import Planner, SequenceMotion, SequencePart, plan_parts
from robotd_tool_space.sequence_plan import plan_sequence
from robotd_tool_space.sequence_run import SequenceRun, require_success
from robotd_tool_space.tool_curves import ToolSpeed
from robotd_tool_space.tool_frames import ToolFrames
from robotd_tool_space.tool_motion import ToolMotion, plan_joint_motion
from robotd_tool_space.tool_stream import ToolStream
from robotd_tool_space.twist import TwistStage

BASE, TOOL = "base", "tool"


class Arrival(NamedTuple):
    """State of a tool when a request for motion arrived, which takes a while to plan.

    Attributes:
        ticket: of ``JointMotion.ticket``.
        interruptions: of motion, before it.
        choices: number of tools and work frames that were chosen before it.
    """

    ticket: int
    interruptions: list[Interruption]
    choices: int

    def require_current(self, now: Arrival) -> None:
        """Raise NotReady for a request that must not begin any more."""
        if now.interruptions != self.interruptions:
            raise NotReady("motion was stopped before this one began")
        if now.choices != self.choices:
            raise NotReady("another tool or work frame was chosen before the motion began")


class RobotTool(ToolFrames):
    """Tool of one joint group: where it is, and motion of it. Any worker thread.

    Poses: the chosen tool in the chosen work frame, matrices (4, 4), m; where no work frame
    is chosen, in the base of the arm. Arguments and errors are those of ``ToolFrames``.
    """

    @cached_property
    def speed(self) -> ToolSpeed:
        """Limits of the tool, of the robot's file."""
        settings = self._settings
        return ToolSpeed(
            settings.velocity_m_s, settings.angular_velocity_rad_s, settings.acceleration_m_s2
        )

    def measured_pose(self, image: ProcessImage | None = None) -> FloatArray | None:
        """Return the measured pose; None while a position is unknown.

        Args:
            image: a copy, which does not change meanwhile; None: the present one.
        """
        positions = (image or self._robot.image.copy()).position[list(self.group.joint_axes)]
        if not np.isfinite(positions).all():
            return None
        return inverse_pose(self.work_frame) @ self._kinematics.forward(positions)

    @property
    def pose(self) -> FloatArray:
        """Pose where the joints are commanded to be: that which a move starts from.

        Raises NotReady: not known, as the joints move.
        """
        return inverse_pose(self.work_frame) @ self._kinematics.forward(self.start())

    def start(self) -> FloatArray:
        """Return the commanded positions (n,) of the joints, which stand.

        Raises NotReady: they move, or are not known.
        """
        self._require_rest("a move of the tool")
        state = self.group.follower.state_at(self._robot.clock.now_ns())
        if state is None or not np.isfinite(state.position).all():
            raise NotReady("the positions of the joints are not known")
        return np.array(state.position)

    def pose_with(self, **components: float) -> FloatArray:
        """Return the present pose with some of its components replaced, m and rad."""
        pose = self.pose
        values = dict(zip(COMPONENTS, [*pose[:3, 3], *rpy_of(pose)], strict=True))
        values |= checked_components(components)
        numbers = [float(values[name]) for name in COMPONENTS]
        return pose_of(numbers[:3], numbers[3:])

    def pose_relative(self, frame: str = BASE, **components: float) -> FloatArray:
        """Return the pose at a way, m and rad, from the present one.

        Args:
            frame: "base": along the axes of the work frame; "tool": along those of the tool.
            components: 0 where not given.
        """
        numbers = [checked_components(components).get(name, 0.0) for name in COMPONENTS]
        return self.relative(pose_of(numbers[:3], numbers[3:]), frame)

    def relative(self, way: FloatArray, frame: str = BASE) -> FloatArray:
        """Return the pose at ``way`` (4, 4) from the present one; see ``pose_relative``."""
        if frame not in (BASE, TOOL):
            raise InvalidArgument(f"frame {frame!r} must be {BASE!r} or {TOOL!r}")
        pose, way = self.pose, checked_pose(way, "way")
        if frame == TOOL:
            return pose @ way
        result = np.eye(4)
        result[:3, :3] = way[:3, :3] @ pose[:3, :3]
        result[:3, 3] = pose[:3, 3] + way[:3, 3]
        return result

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
        target = self.work_frame @ checked_pose(pose)
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
        in_base = [segment.in_base(self.work_frame) for segment in segments]
        plan, start = self._planner(constant_speed=constant_speed), self.start()
        with self._noted():
            return plan(start, in_base, None)

    def plan_parts(
        self, steps: Sequence[SequenceStep], *, constant_speed: bool = False
    ) -> list[SequencePart]:
        """Return the motions of a sequence and the waits between them, planned whole.

        Arguments and errors: see ``plan_sequence``.
        """
        if not steps:
            raise InvalidArgument("a sequence needs a segment")
        start = self.start()
        with self._noted():
            plan = self._planner(constant_speed=constant_speed)
            return plan_parts([step.in_base(self.work_frame) for step in steps], start, plan)

    def plan_behind(
        self, start: FloatArray, first: int, steps: Sequence[SequenceStep]
    ) -> list[SequencePart]:
        """Return the parts of ``steps`` from rest at ``start`` (n,), behind ``first`` others.

        Errors: see ``plan_sequence``.
        """
        in_base = [step.in_base(self.work_frame) for step in steps]
        return plan_parts(in_base, start, self._planner(constant_speed=False), first)

    def plan_further(
        self, last: SequenceMotion, steps: Sequence[SequenceStep]
    ) -> list[SequencePart]:
        """Return the parts of a motion with ``steps`` behind it. Errors: see ``plan_sequence``."""
        in_base = [*last.segments, *(step.in_base(self.work_frame) for step in steps)]
        plan = self._planner(constant_speed=False)
        return plan_parts(in_base, last.motion.positions[0], plan, last.first)

    def join(self, running: ToolMotion, longer: ToolMotion, after_s: float) -> JoinedMotion | None:
        """Return the change from one motion to another. Arguments: see ``motion_join.join``."""
        limits = self.group.follower.limits
        return join(running, longer, after_s, limits, self._kinematics, self.speed)

    def extend(self, execution: TrajectoryExecution, joined: JoinedMotion) -> bool:
        """Continue an execution on a joined motion; False: it has to end first."""
        request = joined.motion.request(self.group.joint_names)
        try:
            return self.group.follower.extend(execution, request, joined.same_s)
        except Unsupported:  # the device interpolates: it comes to rest first
            return False

    def _planner(self, *, constant_speed: bool) -> Planner:
        kinematics, limits, speed = self._kinematics, self.group.follower.limits, self.speed

        def plan(
            start: FloatArray, segments: Sequence[MotionSegment], first: int | None
        ) -> ToolMotion:
            return plan_sequence(
                kinematics,
                limits,
                start,
                segments,
                speed,
                constant_speed=constant_speed,
                first=first,
            )

        return plan

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
        arrival = self.arrive()
        run = self.sequence(self.plan_parts(steps, constant_speed=constant_speed), arrival)
        require_success(*run.run())

    def sequence(self, parts: Sequence[SequencePart], arrival: Arrival) -> SequenceRun:
        """Return the execution of a sequence, checked whole. Arguments, errors: of the class."""
        with self._noted():
            return SequenceRun(self._robot, self, parts, arrival)

    def queue(self) -> MotionQueue:
        """Return an empty queue of segments, as a context."""
        return MotionQueue(self)

    def execute(self, motion: ToolMotion, arrival: Arrival | None = None) -> None:
        """Execute a planned motion as ``follow``, and set its outputs on the way.

        Raises OperationError: it ended elsewhere; or, of an output, its error, which stops the arm.
        """
        run = self.sequence([SequenceMotion(0, (), motion)], arrival or self.arrive())
        require_success(*run.run())

    def check(self, motion: ToolMotion) -> None:
        """Check a motion from rest at its start; nothing moves. Raises TrajectoryRejected."""
        request = motion.request(self.group.joint_names)
        self.group.follower.check(request, motion.positions[0])

    def wait(
        self,
        execution: TrajectoryExecution,
        on_tick: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Wait for the end of a motion; a stepped clock is stepped.

        Args:
            on_tick: called in each period meanwhile with the time of the motion, s.
        """

        def ended() -> bool:
            on_tick(execution.progress().time_s)
            return execution.outcome is not None

        poll_s = 1.0 / self._robot.descriptor.cycle.rate_hz
        while not wait_until(ended, 60.0, self._robot.clock, poll_s):
            pass

    def stream(self, **options: Any) -> ToolStream:
        """Return an open stream of twists; ``options`` and errors are those of ``JointStreams``."""
        _ = self._kinematics.task  # takes a while: not in the control loop
        stage = TwistStage(lambda: self._kinematics, self.group.motion_limits)
        return ToolStream(self.group.stream(**options), stage)

    def arrive(self) -> Arrival:
        """Note that a request for motion has arrived. Any thread."""
        newest = self._robot.rearming.interruptions.newest
        interruptions = newest(self.group.joint_axes, in_mode=True, follows_speed=True)
        return Arrival(self.group.motion.ticket(), interruptions, self.choices)

    @contextmanager
    def follow(
        self, motion: ToolMotion, arrival: Arrival | None = None
    ) -> Iterator[TrajectoryExecution]:
        """Start a planned motion as a context; leaving it stops the motion.

        Args:
            motion: planned.
            arrival: of the request, before it was planned; None: it arrives now.

        Raises NotReady, TrajectoryRejected: the joints have moved since, or cannot be commanded;
            since the arrival motion was stopped, or another tool or work frame was chosen.
        """
        arrival = arrival or self.arrive()
        with self._noted():
            arrival.require_current(self.arrive())
        request = motion.request(self.group.joint_names)
        with self.group.follower.follow(request, ticket=arrival.ticket) as execution:
            arrival.require_current(self.arrive())  # a stop that did not find it yet
            yield execution

    @contextmanager
    def _noted(self) -> Iterator[None]:
        """Note an error as the rejection of a goal, as trajectories do."""
        try:
            yield
        except RobotdError as error:
            data = {"outcome": "rejected", "joints": list(self.group.joint_names)}
            self._robot.events.add(
                EventKind.GOAL, "tool", f"goal rejected: {error}", level=Level.WARNING, data=data
            )
            raise
