"""Timing of the control periods: deadlines, tasks with rates of their own, and statistics."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robotd.arrays import IntArray
from robotd.clock import NANOSECONDS, Clock
from robotd.device.process_image import ProcessImage
from robotd.log import get_logger

log = get_logger("control")

STATISTICS_PERIODS = 8192  # periods kept for percentiles: 16 s at 500 Hz
YIELD_AHEAD_NS = 120_000  # other threads begin no work in this time before a period
SHIFT_DIVISOR = 100  # the period divided by it is the largest shift
WAITS, WAIT_S = 6, 5e-5  # in fact 0.1 ms each: wake-up latency of the system

Task = Callable[[ProcessImage], None]


@dataclass(frozen=True)
class LoopReport:
    """Timing snapshot; times in microseconds, over the last ``samples`` periods.

    Attributes:
        cycles, missed: control periods run and deadlines missed since the start.
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
class PeriodSamples:
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
        self._start_ns, self._lateness_ns, self._execution_ns = np.zeros(
            (3, STATISTICS_PERIODS), np.int64
        )
        # A memory view takes one number several times faster than an array.
        self._cells = (self._start_ns.data, self._lateness_ns.data, self._execution_ns.data)

    def record(self, late_ns: int, start_ns: int, end_ns: int) -> None:
        """Record a period from ``start_ns`` to ``end_ns``, begun ``late_ns`` late. Loop thread."""
        starts, lateness, execution = self._cells
        slot = self.cycles % STATISTICS_PERIODS
        starts[slot], lateness[slot], execution[slot] = start_ns, late_ns, end_ns - start_ns
        self.last = (start_ns, late_ns, end_ns - start_ns)
        self.cycles += 1

    def samples(self) -> PeriodSamples:
        """Return the last ``STATISTICS_PERIODS``; consistent once the control loop has ended."""
        first = max(0, self.cycles - STATISTICS_PERIODS)
        order = np.arange(first, self.cycles) % STATISTICS_PERIODS
        return PeriodSamples(
            self._start_ns[order], self._lateness_ns[order], self._execution_ns[order]
        )

    def report(self) -> LoopReport:
        """Return the figures of the last ``STATISTICS_PERIODS`` periods; zeros before the first."""
        cycles = self.cycles
        samples = min(cycles, STATISTICS_PERIODS)
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


class PeriodDeadlines:
    """Deadlines of one control loop. Control-loop thread, except ``wait_while_imminent``.

    Args:
        skips_start: a period that starts too late is skipped, for devices that hold: drives would
            count its SYNC and the next one as one. False: it begins at once, for devices that
            extrapolate.
        imminent: other threads wait for a period; not in simulated time.

    Attributes:
        start_ns: of the current period, on the clock; later than its deadline by the lateness.
    """

    def __init__(
        self,
        clock: Clock,
        period_ns: int,
        stats: LoopStatistics,
        *,
        skips_start: bool,
        imminent: bool,
    ) -> None:
        self._stats = stats
        self._clock, self._period_ns = clock, period_ns
        self._skips_start, self._imminent = skips_start, imminent
        self._due_ns = 0  # of the next or current period; 0: no thread has to wait for it
        self._late_ns = 0  # of deadlines missed since the last period
        self.start_ns = 0
        self._deadline_ns = 0  # of the current period
        self._nominal_ns = 0  # its nominal time; 0: not fixed yet
        self._shift_ns = 0  # of the next deadline
        self._max_shift_ns = period_ns // SHIFT_DIVISOR

    def begin(self, deadline_ns: int) -> tuple[int, bool]:
        """Return the deadline of the next period from ``deadline_ns`` on, and whether it is due.

        Missed deadlines are skipped, never made up for in a burst.
        """
        self.start_ns = self._clock.now_ns()
        self._late_ns = max(self._late_ns, self.start_ns - deadline_ns)
        missed = self._overrun(deadline_ns) if self._skips_start else 0
        self._deadline_ns, self._nominal_ns = deadline_ns + missed * self._period_ns, 0
        return self._deadline_ns, not missed or self._deadline_ns <= self.start_ns

    def nominal(self, time_ns: int) -> int:
        """Return the nominal time of the period that began at the deadline ``time_ns``.

        For devices that extrapolate it is fixed when the image has been read: setpoints for
        deadlines that a late start or a slow read has missed would be late, too.
        """
        missed = 0 if self._skips_start else self._overrun(time_ns)
        self._nominal_ns = time_ns + missed * self._period_ns
        return self._nominal_ns

    def shift(self, shift_ns: int) -> None:
        """Shift the next deadline by ``shift_ns``, at most 1 % of a period."""
        self._shift_ns = max(-self._max_shift_ns, min(shift_ns, self._max_shift_ns))

    def end(self) -> int:
        """Record the current period; return the next deadline."""
        self._stats.record(self._late_ns, self.start_ns, self._clock.now_ns())
        shift_ns, self._shift_ns, self._late_ns = self._shift_ns, 0, 0
        nominal_ns = self._nominal_ns or self.nominal(self._deadline_ns)
        return nominal_ns + self._period_ns + shift_ns

    def _overrun(self, time_ns: int) -> int:
        """Count the deadlines from ``time_ns`` on that have passed by more than half a period."""
        period_ns = self._period_ns
        missed = max(0, (self._clock.now_ns() - time_ns + period_ns // 2 - 1) // period_ns)
        self._stats.missed += missed
        return missed

    def expect(self, deadline_ns: int) -> None:
        """Set the next deadline; 0: there is none."""
        if self._imminent:
            self._due_ns = deadline_ns

    def wait_while_imminent(self) -> None:
        """Wait while a period is imminent or running, 1 ms at most. Any other thread."""
        for _ in range(WAITS):
            if not self._due_ns or self._clock.now_ns() < self._due_ns - YIELD_AHEAD_NS:
                return
            time.sleep(WAIT_S)


@dataclass
class _Periodic:
    task: Task
    name: str
    period_ns: int
    due_ns: int = 0
    failing: bool = False


class PeriodicTasks:
    """Tasks with a rate each. ``add`` by any thread, ``run`` by the control loop."""

    def __init__(self, period_ns: int, image: ProcessImage) -> None:
        self._slack_ns = period_ns // 2
        self._image = image
        self._first: list[_Periodic] = []  # before the image is read
        self._others: list[_Periodic] = []

    def add(self, rate_hz: float, name: str, task: Task, *, first: bool) -> None:
        """Add a task; ``first``: it runs before the image is read."""
        tasks = self._first if first else self._others
        tasks.append(_Periodic(task, name, round(NANOSECONDS / rate_hz)))

    def run(self, time_ns: int, *, first: bool) -> None:
        """Run the tasks due at ``time_ns``; an exception is logged once for each task."""
        for periodic in self._first if first else self._others:
            if time_ns + self._slack_ns < periodic.due_ns:
                continue
            behind = time_ns - periodic.due_ns > periodic.period_ns
            periodic.due_ns = (time_ns if behind else periodic.due_ns) + periodic.period_ns
            try:
                periodic.task(self._image)
                periodic.failing = False
            except Exception:
                if not periodic.failing:
                    log.exception("a control-loop task failed", task=periodic.name)
                periodic.failing = True
