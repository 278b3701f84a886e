"""Execution of a sequence: its motions one after the other, with the waits between them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from robotd.api import (
    FloatArray,
    InvalidArgument,
    NotReady,
    OperationError,
    RobotdError,
    wait_until,
)
from robotd.api.robots import Outcome, Robot, TrajectoryExecution
from robotd_tool_space.paths.path_outputs import OutputSetter
from robotd_tool_space.paths.segments import MotionSegment, SequenceStep
from robotd_tool_space.sequences.planned_tool import Arrival, PlannedTool
from robotd_tool_space.sequences.sequence_parts import SequenceMotion, SequencePart, SequenceWait

POLL_S = 0.01
LEADS_S = (0.1, 0.3, 0.9)  # until a longer motion takes over, after it is planned
ENDED = "the sequence has ended: begin another one"
LOOP_S = 60.0  # of one wait in a loop without an end


class SequenceProgress(NamedTuple):
    """State of a sequence.

    Attributes:
        segment: number of the present one, from 1; 0: none has begun.
        segments: number of all.
        part: 0 to 1 of the planned duration, without waits.
        waiting: it rests in a wait.
    """

    segment: int
    segments: int
    part: float
    waiting: bool


class SequenceRun:
    """Executes a planned sequence once.

    One worker thread calls ``run``. Any other may call ``append``, ``cancel`` and ``progress``.

    Args:
        robot: whose inputs are waited for.
        tool: that moves.
        parts: planned from where the arm is.
        arrival: of the request: what stops motion, or moves the arm, later ends the sequence.

    Raises:
        InvalidArgument: an input does not exist; NotReady, Unsupported: it cannot be read.
        TrajectoryRejected: a part cannot be executed, such as by a collision. Nothing moves.
    """

    def __init__(
        self, robot: Robot, tool: PlannedTool, parts: Sequence[SequencePart], arrival: Arrival
    ) -> None:
        self._robot, self._tool, self._arrival = robot, tool, arrival
        self._left = list(parts)
        self._present: SequencePart | None = None
        self._execution: TrajectoryExecution | None = None
        self._outputs: OutputSetter | None = None
        self._canceled = self._has_ended = False
        self._lock = threading.Lock()  # of the parts, for moments
        self._append_lock = threading.Lock()  # of one request to append
        self._done_s, self._time_s = 0.0, 0.0  # of planned motion: before this part, and of it
        self._end = _end(parts, tool.start())  # positions of the joints
        self._check(parts, is_first=True)

    def run(self, on_tick: Callable[[], None] = lambda: None) -> tuple[Outcome, str]:
        """Execute the sequence; return its outcome with the reason.

        ``on_tick``: called while it moves or waits, some times in 40 ms.

        Raises RobotdError: the first motion was rejected, nothing has moved; or an output cannot be
            set, which stops the arm.
        """
        outcome, message, has_begun = Outcome.SUCCEEDED, "nothing to do", False
        try:
            while outcome is Outcome.SUCCEEDED and (part := self._next()):
                if isinstance(part, SequenceWait):
                    outcome, message = self._wait(part, on_tick)
                else:
                    outcome, message = self._move(part, on_tick)
                has_begun = True
        except NotReady as error:
            if not has_begun:
                raise
            number = self.progress().segment
            return Outcome.STOPPED, f"ended before segment {number}: {error}"
        finally:
            self._has_ended = True
        return outcome, message

    def append(self, steps: Sequence[SequenceStep]) -> bool:
        """Plan and check further steps, and append them while the sequence runs. Worker thread.

        Returns True where the path goes on without a stop, as far as a blend asks for that; False
        where it was too late, and the path ends at rest before the first of them.

        Raises Unreachable, InvalidArgument, TrajectoryRejected: with the segment, nothing is
        appended; NotReady: the sequence has ended, or motion was stopped.
        """
        if not steps:
            raise InvalidArgument("a sequence needs a segment")
        with self._append_lock:
            while True:
                last, end = self._last(), self._end
                if (
                    isinstance(last, SequenceMotion)
                    and isinstance(steps[0], MotionSegment)
                    and last.until is None
                    and steps[0].until is None
                    and self._join(last, self._tool.plan_further(last, steps))
                ):
                    return True
                parts = self._tool.plan_behind(end, last.end, steps)
                self._check(parts, is_first=False)
                with self._lock:
                    if self._has_ended:
                        raise NotReady(ENDED)
                    newest = self._left[-1] if self._left else self._present
                    if newest is last and self._end is end:  # a contact moves the end
                        self._left += parts
                        self._end = _end(parts, self._end)
                        return False

    def _last(self) -> SequencePart:
        """Return the last part, which is present or to come. Raises NotReady: it has ended."""
        self._arrival.require_current(self._tool.arrive())
        with self._lock:
            last = self._left[-1] if self._left else self._present
            if self._has_ended or self._canceled or last is None:
                raise NotReady(ENDED)
            return last

    def _join(self, last: SequenceMotion, parts: Sequence[SequencePart]) -> bool:
        """Replace the last part by longer ones; False: that would need a stop, or a jump."""
        longer, *rest = parts
        self._check(rest, is_first=False)
        if not isinstance(longer, SequenceMotion):
            return False
        if self._present is last:
            return self._join_present(last, longer, rest)
        self._check([longer], is_first=False)
        with self._lock:
            if not (self._left and self._left[-1] is last):  # it has begun meanwhile
                return False
            self._left[-1:] = parts
            self._end = _end(parts, self._end)
            return True

    def _join_present(
        self, last: SequenceMotion, longer: SequenceMotion, rest: Sequence[SequencePart]
    ) -> bool:
        """Continue the motion under way on a longer one; False: it is too late."""
        for lead_s in LEADS_S:
            execution, outputs = self._execution, self._outputs
            if execution is None or outputs is None:
                break
            after_s = max(execution.progress().time_s, 0.0) + lead_s
            joined = self._tool.join(last.motion, longer.motion, after_s)
            if joined is None:
                break
            if self._tool.extend(execution, joined):
                outputs.exchange(joined.same_s, joined.motion.outputs)
                with self._lock:
                    self._present = longer._replace(motion=joined.motion)
                    self._left += rest
                    self._end = _end([longer, *rest], self._end)
                return True
        return False

    def _next(self) -> SequencePart | None:
        """Return the next part, which is the present one from now on; None: there is none."""
        with self._lock:
            if isinstance(self._present, SequenceMotion):
                self._done_s += self._present.motion.duration_s
            if not self._left:
                self._has_ended = True
                return None
            self._time_s = 0.0
            self._present = self._left.pop(0)
            return self._present

    @property
    def accepts(self) -> bool:
        """True while steps can be appended: it has not ended."""
        return not (self._has_ended or self._canceled)

    def cancel(self) -> None:
        """Stop on the path, or end a wait."""
        self._canceled = True
        if (execution := self._execution) is not None:
            execution.cancel()

    def progress(self) -> SequenceProgress:
        """Return what is executed."""
        with self._lock:
            return self._progress()

    def _progress(self) -> SequenceProgress:
        part, time_s = self._present, self._time_s
        members = [part, *self._left] if part else self._left
        motions = [member for member in members if isinstance(member, SequenceMotion)]
        count = members[-1].end
        total_s = self._done_s + sum(planned.motion.duration_s for planned in motions)
        share = min((self._done_s + time_s) / total_s, 1.0) if total_s else 1.0
        if part is None:
            return SequenceProgress(0, count, 0.0, waiting=False)
        if isinstance(part, SequenceWait):
            return SequenceProgress(part.first + 1, count, share, waiting=True)
        number = int(np.searchsorted(part.motion.ends_s[:-1], time_s, "right"))
        return SequenceProgress(part.first + number + 1, count, max(share, 0.0), waiting=False)

    def _check(self, parts: Sequence[SequencePart], *, is_first: bool) -> None:
        """Raise what would reject a part later; the first motion is checked when it begins."""
        for part in parts:
            if isinstance(part, SequenceMotion):
                if not is_first:
                    self._tool.check(part.motion)
                is_first = False
            elif part.wait.input is not None:
                try:
                    self._robot.io.input_bit(*part.wait.input)
                except InvalidArgument as error:
                    raise InvalidArgument(f"{part.name}: {error}") from None

    def _move(self, part: SequenceMotion, on_tick: Callable[[], None]) -> tuple[Outcome, str]:
        motion = part.motion
        outputs = self._outputs = OutputSetter(self._robot.io, motion.outputs)

        def tick(time_s: float) -> None:
            self._time_s = time_s
            outputs.advance(time_s)
            on_tick()

        with self._tool.follow(motion, self._arrival, part.until) as execution:
            self._execution = execution
            if self._canceled:  # before it was known
                execution.cancel()
            self._tool.wait(execution, tick)
            outcome, message = execution.outcome or Outcome.FAULT, execution.message
            self._execution = None
            if outcome is Outcome.SUCCEEDED:
                tick(execution.trajectory.duration_s)
        if part.until is None:
            return outcome, message
        if outcome is Outcome.CONTACT:
            return self._go_on_from_contact(part, message)
        return (Outcome.STOPPED if outcome is Outcome.SUCCEEDED else outcome), message

    def _go_on_from_contact(self, part: SequenceMotion, message: str) -> tuple[Outcome, str]:
        """Plan what is left from where a contact has ended a part."""
        try:
            start, planned = self._tool.start(), False
            while not planned:
                with self._lock:
                    left = list(self._left)
                parts = self._tool.plan_rest(start, left)
                self._check(parts, is_first=True)
                with self._lock:
                    planned = [*map(id, self._left)] == [*map(id, left)]
                    if planned:  # nothing was appended meanwhile
                        self._left, self._end = parts, _end(parts, start)
        except RobotdError as error:
            text = f"segment {part.first + 1}: {message}; what follows cannot be executed"
            return Outcome.STOPPED, f"{text} from there: {error}"
        return Outcome.SUCCEEDED, message

    def _wait(self, part: SequenceWait, on_tick: Callable[[], None]) -> tuple[Outcome, str]:
        wait, ended = part.wait, False
        stopped = ""

        def tick() -> bool:
            nonlocal ended, stopped
            on_tick()
            try:
                self._arrival.require_current(self._tool.arrive())
                ended = wait.input is not None and (
                    self._robot.io.input_bit(*wait.input) is wait.level
                )
            except RobotdError as error:
                stopped = str(error)
            return ended or self._canceled or bool(stopped)

        limit_s = wait.timeout_s if wait.time_s is None else wait.time_s
        while not wait_until(tick, limit_s or LOOP_S, self._robot.clock, POLL_S):
            if limit_s is not None:
                break
        if stopped:
            return Outcome.STOPPED, f"{part.name}: {stopped}"
        if self._canceled:
            return Outcome.CANCELED, f"{part.name}: canceled by the client"
        if wait.input is None or ended:
            return Outcome.SUCCEEDED, f"{part.name}: over"
        byte, bit = wait.input
        level = "on" if wait.level else "off"
        text = f"input {byte}.{bit} is not {level} after {wait.timeout_s:g} s"
        return Outcome.STOPPED, f"{part.name}: {text}"


def require_success(outcome: Outcome, message: str) -> None:
    """Raise OperationError for a motion that ended early."""
    if outcome is not Outcome.SUCCEEDED:
        raise OperationError(f"the motion of the tool ended early: {message}")


def _end(parts: Sequence[SequencePart], start: FloatArray) -> FloatArray:
    """Return the positions (n,) where parts end that begin at ``start``."""
    motions = [part.motion for part in parts if part.motion is not None]
    return motions[-1].positions[-1] if motions else start
