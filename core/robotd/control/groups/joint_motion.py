"""Claim of the joints, and their handover from one setpoint source to the next."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TypeVar

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, wait_until
from robotd.clock.simulated import untimed
from robotd.control.loop.setpoint_mixer import SourceSlot
from robotd.control.loop.setpoint_source import PREEMPTED, Outcome, SetpointSource
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.device.axes import Axes
from robotd.device.state import CommandMode
from robotd.errors import NotReady, RobotdError
from robotd.log import get_logger
from robotd.motion import MotionState, Trajectory

log = get_logger("axes")

OWNER = "trajectory"
TAKEOVER_LEAD_S = 0.03  # planning time of a source that takes over from a moving one
STOP_TIMEOUT_S = 10.0  # of a controlled stop
MIN_COMMAND_CHANGE_RAD = 1e-6  # change of a command that counts as motion
MAX_PLANNING_ATTEMPTS = 8  # of one source, each with twice the lead of the one before

Source = TypeVar("Source", bound=SetpointSource)
Planner = Callable[[MotionState], Callable[[int], Source]]


class JointMotion:
    """Starts setpoint sources for the joints, one at a time.

    A newer source of the same owner takes over; that of another one is rejected while they move.

    The joints are claimed from the first ``start`` until every source is released. Any worker
    thread may call; sources are planned one after the other.

    Attributes:
        lock: held while a source is planned and submitted; re-entrant.
    """

    def __init__(self, axes: Axes, slot: SourceSlot, joint_axes: Sequence[int]) -> None:
        self.lock = threading.RLock()
        self._axes, self._slot, self._clock = axes, slot, axes.clock
        self._joint_axes = list(joint_axes)
        self._claim = ExitStack()
        self._owner = ""  # of the claim
        self._is_alone = False  # nothing takes over
        self._tickets = itertools.count(1)
        self._newest = 0  # ticket of the last source that was started
        self._active = 0

    def ticket(self) -> int:
        """Return the place of a request in the order in which requests have arrived."""
        return next(self._tickets)

    def start(
        self,
        plan: Planner[Source],
        start_ns: int = 0,
        *,
        owner: str = OWNER,
        takeover: bool = False,
        ticket: int = 0,
    ) -> Source:
        """Plan a source from the present motion and submit it; ``release`` has to follow.

        Planning is repeated while the running source has changed meanwhile.

        Args:
            plan: returns, for the state to start from, a function that makes the source for a
                start time. It may raise a rejection; a running source then continues.
            start_ns: earliest start, monotonic; 0: as soon as possible.
            takeover: also from the moving source of another owner.
            ticket: of ``ticket``, taken when the request arrived; 0: it arrives now.

        Raises NotReady: motion is stopped, a joint cannot be commanded now, it moves for another
        owner, or a request that arrived later was started before this one.
        """
        # Simulated time must not outrun planning.
        with self.lock, untimed(self._clock), self._released_on_failure():
            ticket = ticket or self.ticket()
            if ticket < self._newest:
                raise NotReady(PREEMPTED)
            foreign = self._owner != owner and not takeover
            if self._is_alone or (self._slot.active and foreign):
                name = self._axes.names[self._joint_axes[0]]
                raise NotReady(f"{name}: in use by {self._owner}")
            for attempt in range(MAX_PLANNING_ATTEMPTS):
                self._axes.stop_latch.check()
                lead_ns = round(TAKEOVER_LEAD_S * 2**attempt * NANOSECONDS)
                running = self._slot.running
                if running is None or running.completion.done:
                    # At once, unless it takes longer than a period to make the source.
                    earliest_ns = self._clock.now_ns() + lead_ns if attempt else 0
                    source = self._start_at_rest(plan, running, max(earliest_ns, start_ns), owner)
                else:
                    splice_ns = max(self._clock.now_ns() + lead_ns, start_ns)
                    source = self._splice(plan, running, splice_ns)
                if source is not None:
                    self._axes.hand_over(self._joint_axes, owner)
                    self._owner, self._newest = owner, ticket
                    self._active += 1
                    return source
            raise NotReady(
                f"the joints did not go on as planned for, {MAX_PLANNING_ATTEMPTS} times in a row"
            )

    def start_alone(
        self, axes: Sequence[int], mode: CommandMode, make: Callable[[int], Source], owner: str
    ) -> Source:
        """Submit a source for ``axes`` at rest, in another command mode; ``release`` has to follow.

        No other source takes over from it, and the joints return to position mode after it.

        Args:
            axes: some of the joints' axes.
            make: returns the source for its start time.

        Raises NotReady: motion is stopped, or an axis cannot be commanded now or moves.
        """
        with self.lock, self._released_on_failure():
            if self._active:
                raise NotReady(f"{self._axes.names[axes[0]]}: in use by {self._owner}")
            self._axes.stop_latch.check()
            self._claim.enter_context(_in_command_mode(self._axes, axes, mode))
            self._claim.enter_context(self._axes.claimed(owner, axes, mode))
            while True:  # again when making it took longer than a period
                source = make(max(self._slot.next_start_ns, self._clock.now_ns()))
                if self._slot.submit(source, None):
                    break
            self._owner, self._is_alone = owner, True
            self._active += 1
            return source

    def release(self, source: SetpointSource) -> None:
        """Stop ``source`` and wait for its end; the last one releases the joints.

        A source that has passed its goal comes to rest by itself. It is stopped when it has not
        after ``STOP_TIMEOUT_S``: it may be paused, or slowed down by the operator.
        """
        has_passed = source.completion.result is not None
        if not (has_passed and self._await_end(source, STOP_TIMEOUT_S)):
            source.completion.request(Outcome.CANCELED, "canceled by the client")
            self._await_end(source, STOP_TIMEOUT_S)
        with self.lock:
            self._active -= 1
            if self._active == 0:
                self._slot.release()
                self._is_alone = False
                self._claim.close()
            self._slot.end_splice()  # ``source`` may have waited for its start

    def stop(self, timeout_s: float = STOP_TIMEOUT_S) -> None:
        """Stop the active sources and wait for their ends.

        After ``timeout_s`` it returns while the joints may still move.
        """
        active = self.cancel()
        for source in active:
            self._await_end(source, timeout_s)

    def cancel(self) -> list[SetpointSource]:
        """Request the stop of the active sources and return them. Any thread."""
        active = self._slot.active
        for source in active:
            source.completion.request(Outcome.CANCELED, "canceled by the client")
        return active

    @property
    def moving(self) -> bool:
        """A source is active. Any thread."""
        return bool(self._slot.active)

    @property
    def running(self) -> SetpointSource | None:
        """Source that moves the joints; None while there is none. Any thread."""
        source = self._slot.running
        return None if source is None or source.completion.done else source

    def end_trajectories(self, outcome: Outcome, reason: Callable[[Trajectory, float], str]) -> str:
        """Request the end of the active trajectories that have a reason; return the first one.

        Each ends by its own controlled stop, on its path. Any thread; none begins meanwhile where
        the caller holds ``lock``.

        ``reason``: of a trajectory at its present time, s; "": it goes on.
        """
        found = ""
        for source in self._slot.active:
            if not isinstance(source, TrajectoryExecution) or not source.completion.goes_on:
                continue
            if text := reason(source.trajectory, source.time_s):
                source.completion.request(outcome, text)
                found = found or text
        return found

    def command(self) -> FloatArray:
        """Return (m,) position commands of the joints, in rad or m."""
        return self._axes.image.position_command[self._joint_axes]

    @contextmanager
    def _released_on_failure(self) -> Iterator[None]:
        """Release the joints when the block fails and no source is active."""
        try:
            yield
        except BaseException:
            if self._active == 0:
                self._claim.close()
            self._slot.end_splice()
            raise

    def _splice(
        self, plan: Planner[Source], running: SetpointSource, splice_ns: int
    ) -> Source | None:
        """Submit a source from the motion of ``running``; None: plan again, maybe at its rest."""
        while True:
            # The control loop moves ``start_ns`` once a period while the source is slowed down.
            planned_ns = running.start_ns
            state = running.splice_state(splice_ns)
            if running.start_ns == planned_ns:
                break
        if state is not None:
            source = plan(state)(splice_ns)
            return source if self._slot.submit(source, running, planned_ns) else None
        if running.completion.goes_on:
            # It has to stop first, but not for a request that would be rejected anyway.
            plan(MotionState.at_rest(self.command()))(splice_ns)
            running.completion.request(Outcome.PREEMPTED, PREEMPTED)
        if not self._await_end(running, STOP_TIMEOUT_S):
            raise NotReady("the joints did not come to rest after the last trajectory")
        return None

    def _start_at_rest(
        self, plan: Planner[Source], running: SetpointSource | None, start_ns: int, owner: str
    ) -> Source | None:
        """Claim the axes and submit a source from standstill; None when they have moved."""
        for axis in self._joint_axes:
            if error := self._axes.rejection(axis, CommandMode.POSITION, self._owner):
                raise error
        # A plan from the measured position would jump.
        state = MotionState.at_rest(self._axes.known_commands(self._joint_axes))
        make = plan(state)
        if not self._slot.release_after(running):
            return None
        # Claim again: after a fault the device has taken axes out of the stream.
        self._claim.close()
        self._claim.enter_context(self._axes.claimed(owner, self._joint_axes))
        self._owner = owner
        if (np.abs(self.command() - state.position) > MIN_COMMAND_CHANGE_RAD).any():
            return None
        earliest_ns = max(self._slot.next_start_ns, self._clock.now_ns())
        source = make(max(earliest_ns, start_ns))
        return source if self._slot.submit(source, None) else None

    def _await_end(self, source: SetpointSource, timeout_s: float) -> bool:
        return wait_until(lambda: source.completion.done, timeout_s, self._clock)


@contextmanager
def _in_command_mode(axes: Axes, chosen: Sequence[int], mode: CommandMode) -> Iterator[None]:
    """Put idle axes into ``mode`` for the block; afterwards they are in position mode.

    Raises the errors of ``Axes.set_command_mode``; an axis that does not return is logged.
    """
    changed: list[int] = []
    try:
        for axis in chosen:
            axes.set_command_mode(axis, mode)
            changed.append(axis)
        yield
    finally:
        for axis in changed:
            try:
                axes.set_command_mode(axis, CommandMode.POSITION)
            except RobotdError as error:
                log.warning("an axis stays in its mode", mode=mode.name.lower(), reason=str(error))
