"""Timing statistics of the control loop: lateness, execution time, missed deadlines."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robotd.arrays import IntArray
from robotd.clock import NANOSECONDS

WINDOW = 8192  # periods kept for percentiles: 16 s at 500 Hz


@dataclass(frozen=True)
class LoopReport:
    """Timing snapshot; times in microseconds, over the last ``samples`` periods.

    Attributes:
        cycles, missed: periods run and deadlines missed since the start.
        late_setpoints: setpoints that came too late and were not sent, since the start.
        rate_hz: measured rate over the window; NaN before the second period.
        lateness_p50_us, lateness_p99_us, lateness_max_us: wake-up after the deadline.
        execution_p50_us, execution_p99_us, execution_max_us: work done in a period.
    """

    cycles: int
    missed: int
    samples: int
    rate_hz: float
    lateness_p50_us: float
    lateness_p99_us: float
    lateness_max_us: float
    execution_p50_us: float
    execution_p99_us: float
    execution_max_us: float
    late_setpoints: int = 0


@dataclass(frozen=True, eq=False)
class CycleSamples:
    """Timing of the last periods, oldest first; int64 nanoseconds of shape (samples,).

    Attributes:
        start_ns: monotonic time at which the work began.
        lateness_ns: ``start_ns`` after the deadline.
        execution_ns: duration of the work.
    """

    start_ns: IntArray
    lateness_ns: IntArray
    execution_ns: IntArray


class LoopStatistics:
    """Ring buffers written by the control loop; any thread may call ``report``.

    Attributes:
        cycles, missed, late_setpoints: counters since the start, see ``LoopReport``.
        last: start, lateness and execution time of the last period, ns.
    """

    def __init__(self) -> None:
        self.last = (0, 0, 0)
        self.cycles = 0
        self.missed = 0
        self.late_setpoints = 0
        self._start_ns, self._lateness_ns, self._execution_ns = np.zeros((3, WINDOW), np.int64)
        # A memory view takes one number several times faster than an array.
        self._cells = (self._start_ns.data, self._lateness_ns.data, self._execution_ns.data)

    def record(self, late_ns: int, start_ns: int, end_ns: int) -> None:
        """Record a period from ``start_ns`` to ``end_ns``, begun ``late_ns`` late. Loop thread."""
        starts, lateness, execution = self._cells
        slot = self.cycles % WINDOW
        starts[slot], lateness[slot], execution[slot] = start_ns, late_ns, end_ns - start_ns
        self.last = (start_ns, late_ns, end_ns - start_ns)
        self.cycles += 1

    def samples(self) -> CycleSamples:
        """Return the last ``WINDOW`` periods; consistent once the control loop has ended."""
        first = max(0, self.cycles - WINDOW)
        order = np.arange(first, self.cycles) % WINDOW
        return CycleSamples(
            self._start_ns[order], self._lateness_ns[order], self._execution_ns[order]
        )

    def report(self) -> LoopReport:
        """Return the figures of the last ``WINDOW`` periods; zeros before the first."""
        cycles = self.cycles
        samples = min(cycles, WINDOW)
        started = self._start_ns[:samples]
        span_s = float(np.ptp(started)) / NANOSECONDS if samples else 0.0
        rate_hz = (samples - 1) / span_s if span_s > 0 else math.nan
        return LoopReport(
            cycles,
            self.missed,
            samples,
            rate_hz,
            *_percentiles_us(self._lateness_ns[:samples]),
            *_percentiles_us(self._execution_ns[:samples]),
            late_setpoints=self.late_setpoints,
        )


def _percentiles_us(values_ns: IntArray) -> tuple[float, float, float]:
    """Return p50, p99 and the maximum, interpolated as by ``np.percentile``; 0 without values.

    That imports ``numpy.ma`` when it is first called: 10 ms without the interpreter for others.
    """
    if not len(values_ns):
        return 0.0, 0.0, 0.0
    ordered = np.sort(values_ns)
    places = np.array([0.5, 0.99, 1.0]) * (len(ordered) - 1)
    p50, p99, top = np.interp(places, np.arange(len(ordered)), ordered) / 1000.0
    return float(p50), float(p99), float(top)
