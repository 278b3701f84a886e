"""Outputs that are set at places of a motion."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import NamedTuple, Protocol


class OutputWriter(Protocol):
    """Sets an output; that of a robot is ``robot.io``."""

    def set_output_bit(self, byte: int, bit: int, value: bool) -> None: ...


@dataclass(frozen=True)
class PathOutput:
    """Output that is set near the end of a segment; where its corner is rounded, near the middle.

    Attributes:
        byte, bit: of the image of outputs; ``robot.io.outputs`` has those that have names.
        on: level.
        at_m: distance of the tool along its path from there, below 0 before it.
        at_s: time of the motion from that place, below 0 before it, at a speed of 100 %.
    """

    byte: int
    bit: int
    on: bool
    at_m: float = 0.0
    at_s: float = 0.0


class TimedOutput(NamedTuple):
    """Output of a planned motion, at a time of it."""

    time_s: float
    output: PathOutput


class OutputSetter:
    """Sets the outputs of one motion, each once. Any worker thread.

    Args:
        io: sets them.
        outputs: of the motion.
    """

    def __init__(self, io: OutputWriter, outputs: tuple[TimedOutput, ...]) -> None:
        self._io = io
        self._left = sorted(outputs, key=lambda timed: timed.time_s)
        self._lock = threading.Lock()

    def advance(self, time_s: float) -> None:
        """Set the outputs up to ``time_s`` of the motion. Raises the errors of the output."""
        while output := self._due(time_s):
            self._io.set_output_bit(output.byte, output.bit, output.on)

    def exchange(self, after_s: float, outputs: tuple[TimedOutput, ...]) -> None:
        """Replace those after ``after_s`` of the motion by those of a longer one."""
        with self._lock:
            before = [timed for timed in self._left if timed.time_s <= after_s]
            after = (timed for timed in outputs if timed.time_s > after_s)
            self._left = before + sorted(after, key=lambda timed: timed.time_s)

    def _due(self, time_s: float) -> PathOutput | None:
        with self._lock:
            if self._left and self._left[0].time_s <= time_s:
                return self._left.pop(0).output
        return None
