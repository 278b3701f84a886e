"""Axes of the simulation that hold setpoints ahead, as the buffers of a motion controller do."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import NANOSECONDS, FloatArray, ProcessImage, Underrun
from robotd_sim import SimAxes

BUFFER_S = 0.02
GAP_PERIODS = 1.5  # beyond the buffers: a longer gap is an underrun

Setpoint = tuple[FloatArray, FloatArray]


class BufferedAxes(SimAxes):
    """Executes one setpoint in each period, ``BUFFER_S`` after it was taken.

    When it has executed the last one in motion, it stops, and ignores setpoints until a gap.
    """

    underrun = Underrun.HOLD
    stream_buffer_s = BUFFER_S

    def begin_stream(self, axes: Sequence[int]) -> None:
        super().begin_stream(axes)
        self._held: deque[Setpoint] = deque()
        self._last: Setpoint | None = None
        self._executing = self._dry = False
        self._period_ns = self._taken_ns = 0

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        if self.ignores(due_ns):
            return
        self._period_ns = self._period_ns or due_ns - self._world.clock.now_ns()
        self._dry, self._taken_ns = False, due_ns
        self._held.append((position.copy(), velocity.copy()))

    def stream_ran_dry(self, due_ns: int) -> bool:
        return self.ignores(due_ns)

    def ignores(self, due_ns: int) -> bool:
        gap_ns = BUFFER_S * NANOSECONDS + GAP_PERIODS * self._period_ns
        return self._dry and due_ns - self._taken_ns <= gap_ns

    def read(self, image: ProcessImage) -> None:
        if self.__dict__.get("_period_ns"):
            self._execute(self._world.clock.now_ns() + self._period_ns)
        super().read(image)

    def _execute(self, due_ns: int) -> None:
        depth = round(BUFFER_S * NANOSECONDS / self._period_ns)
        self._executing = bool(self._held) and (self._executing or len(self._held) >= depth)
        if self._executing:
            self._last = self._held.popleft()
        elif self._last is not None:
            moved = bool(self._last[1].any())
            self._dry |= moved
            self._last = (self._last[0], np.zeros_like(self._last[1]))
        if self._last is not None:
            super().stream(*self._last, due_ns)


class Buffered(Mutant):
    """A backend without a fault."""

    found_by = ""
    Axes = BufferedAxes
