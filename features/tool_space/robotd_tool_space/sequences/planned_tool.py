"""Tool of a joint group whose motions are planned, checked and executed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray, InvalidArgument, NotReady, RobotdError, Unsupported, wait_until
from robotd.api.features import EventKind, Level
from robotd.api.robots import ContactLimits, Interruption, TrajectoryExecution, WrenchLimits
from robotd_tool_space.frames.tool_frames import ToolFrames
from robotd_tool_space.paths.segments import MotionSegment, SequenceStep
from robotd_tool_space.paths.tool_curves import ToolSpeed
from robotd_tool_space.paths.tool_motion import ToolMotion
from robotd_tool_space.sequences.motion_join import JoinedMotion, join
from robotd_tool_space.sequences.sequence_parts import (
    Planner,
    SequenceMotion,
    SequencePart,
    has_contacts,
    plan_parts,
)
from robotd_tool_space.sequences.sequence_plan import plan_sequence


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


class PlannedTool(ToolFrames):
    """Tool of one joint group: what executes its motions needs of it. Any worker thread.

    Arguments and errors are those of ``ToolFrames``.
    """

    @cached_property
    def speed(self) -> ToolSpeed:
        """Limits of the tool, of the robot's file."""
        settings = self._settings
        return ToolSpeed(
            settings.velocity_m_s, settings.angular_velocity_rad_s, settings.acceleration_m_s2
        )

    def start(self) -> FloatArray:
        """Return the commanded positions (n,) of the joints, which stand.

        Raises NotReady: they move, or are not known.
        """
        self._require_rest("a move of the tool")
        state = self.group.follower.state_at(self._robot.clock.now_ns())
        if state is None or not np.isfinite(state.position).all():
            raise NotReady("the positions of the joints are not known")
        return np.array(state.position)

    def plan_parts(
        self, steps: Sequence[SequenceStep], *, constant_speed: bool = False
    ) -> list[SequencePart]:
        """Return the motions of a sequence and the waits between them, planned whole.

        Arguments and errors: see ``plan_sequence``.
        """
        if not steps:
            raise InvalidArgument("a sequence needs a segment")
        if constant_speed and has_contacts(steps):
            raise InvalidArgument("a sequence of constant speed has no segment with until")
        start = self.start()
        with self._noted():
            plan = self._planner(constant_speed=constant_speed)
            return plan_parts([step.in_base(self.fixed_work_frame) for step in steps], start, plan)

    def plan_behind(
        self, start: FloatArray, first: int, steps: Sequence[SequenceStep]
    ) -> list[SequencePart]:
        """Return the parts of ``steps`` from rest at ``start`` (n,), after ``first`` others.

        Errors: see ``plan_sequence``.
        """
        in_base = [step.in_base(self.fixed_work_frame) for step in steps]
        return plan_parts(in_base, start, self._planner(constant_speed=False), first)

    def plan_rest(self, start: FloatArray, parts: Sequence[SequencePart]) -> list[SequencePart]:
        """Return parts planned anew from rest at ``start`` (n,). Errors: see ``plan_sequence``."""
        if not parts:
            return []
        steps = [step for part in parts for step in part.steps]
        return plan_parts(steps, start, self._planner(constant_speed=False), parts[0].first)

    def plan_further(
        self, last: SequenceMotion, steps: Sequence[SequenceStep]
    ) -> list[SequencePart]:
        """Return the parts of a motion with ``steps`` after it. Errors: see ``plan_sequence``."""
        in_base = [*last.segments, *(step.in_base(self.fixed_work_frame) for step in steps)]
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

    def arrive(self) -> Arrival:
        """Note that a request for motion has arrived. Any thread."""
        newest = self._robot.rearming.interruptions.newest
        interruptions = newest(self.group.joint_axes, in_mode=True, follows_speed=True)
        return Arrival(self.group.motion.ticket(), interruptions, self.choices)

    @contextmanager
    def follow(
        self,
        motion: ToolMotion,
        arrival: Arrival | None = None,
        contact: ContactLimits | WrenchLimits | None = None,
    ) -> Iterator[TrajectoryExecution]:
        """Start a planned motion as a context; leaving it stops the motion.

        Args:
            motion: planned.
            arrival: of the request, before it was planned; None: it arrives now.
            contact: at which it ends on its way; None: at its end alone.

        Raises NotReady, TrajectoryRejected: the joints have moved since, or cannot be commanded;
            since the arrival motion was stopped, or another tool or work frame was chosen.
        """
        arrival = arrival or self.arrive()
        with self._noted():
            arrival.require_current(self.arrive())
        request = motion.request(self.group.joint_names)
        follower, ticket = self.group.follower, arrival.ticket
        with follower.follow(request, ticket=ticket, contact=contact) as execution:
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
