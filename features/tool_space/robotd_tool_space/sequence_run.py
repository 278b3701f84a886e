"""Execution of a sequence: its motions one after the other, with the waits between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from robotd.api import InvalidArgument, NotReady, RobotdError, wait_until
from robotd.api.robots import Outcome, Robot, TrajectoryExecution
from robotd_tool_space.path_outputs import OutputSetter
from robotd_tool_space.sequence_parts import SequenceMotion, SequencePart, SequenceWait

if TYPE_CHECKING:
    from robotd_tool_space.robot_tool import Arrival, RobotTool

POLL_S = 0.01
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

    One worker thread calls ``run``. Any thread may call ``cancel`` and ``progress``.

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
        self, robot: Robot, tool: RobotTool, parts: Sequence[SequencePart], arrival: Arrival
    ) -> None:
        self._robot, self._tool, self._arrival = robot, tool, arrival
        self._left = list(parts)
        self._present: SequencePart | None = None
        self._execution: TrajectoryExecution | None = None
        self._canceled = False
        self._done_s, self._time_s = 0.0, 0.0  # of planned motion: before this part, and of it
        self._check(parts, is_first=True)

    def run(self, on_tick: Callable[[], None] = lambda: None) -> tuple[Outcome, str]:
        """Execute the sequence; return its outcome with the reason.

        ``on_tick``: called while it moves or waits, some times in 40 ms.

        Raises RobotdError: the first motion was rejected, nothing has moved; or an output cannot be
            set, which stops the arm.
        """
        outcome, message = Outcome.SUCCEEDED, "nothing to do"
        while self._left and outcome is Outcome.SUCCEEDED:
            has_begun = self._present is not None
            if isinstance(self._present, SequenceMotion):
                self._done_s += self._present.motion.duration_s
            self._time_s = 0.0
            part = self._present = self._left.pop(0)
            if isinstance(part, SequenceWait):
                outcome, message = self._wait(part, on_tick)
                continue
            try:
                outcome, message = self._move(part, on_tick)
            except NotReady as error:
                if not has_begun:
                    raise
                return Outcome.STOPPED, f"ended before segment {part.first + 1}: {error}"
        return outcome, message

    def cancel(self) -> None:
        """Stop on the path, or end a wait."""
        self._canceled = True
        if (execution := self._execution) is not None:
            execution.cancel()

    def progress(self) -> SequenceProgress:
        """Return what is executed."""
        part, time_s = self._present, self._time_s
        members = [part, *self._left] if part else self._left
        motions = [member for member in members if isinstance(member, SequenceMotion)]
        last = members[-1]
        count = last.first + (len(last.segments) if isinstance(last, SequenceMotion) else 1)
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
        outputs = OutputSetter(self._robot.io, motion.outputs)

        def tick(time_s: float) -> None:
            self._time_s = time_s
            outputs.advance(time_s)
            on_tick()

        with self._tool.follow(motion, self._arrival) as execution:
            self._execution = execution
            if self._canceled:  # before it was known
                execution.cancel()
            self._tool.wait(execution, tick, every_period=bool(motion.outputs))
            outcome, message = execution.outcome or Outcome.FAULT, execution.message
            self._execution = None
            if outcome is Outcome.SUCCEEDED:
                tick(motion.duration_s)
        return outcome, message

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
