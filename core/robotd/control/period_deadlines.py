"""Deadlines of the control periods: lateness, missed ones, and waiting for the next."""

from __future__ import annotations

import time

from robotd.clock import Clock
from robotd.control.loop_statistics import LoopStatistics

AHEAD_NS = 120_000  # other threads begin no work in this time before a period
MAX_SHIFT = 100  # the period divided by it is the largest shift
WAITS, WAIT_S = 6, 5e-5  # in fact 0.1 ms each: wake-up latency of the system


class PeriodDeadlines:
    """Deadlines of one control loop. Control-loop thread, except ``wait_while_imminent``.

    Args:
        clock: of the control loop.
        period_ns: between two deadlines.
        stats: of the periods.
        skips_start: a period whose start has come too late is skipped, for devices that hold:
            its SYNC would be so close to the next one that drives count the two as one. False:
            it begins at once, for devices that extrapolate.
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
        self._max_shift_ns = period_ns // MAX_SHIFT

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
            if not self._due_ns or self._clock.now_ns() < self._due_ns - AHEAD_NS:
                return
            time.sleep(WAIT_S)
