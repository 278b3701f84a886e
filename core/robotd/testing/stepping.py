"""A clock on which waiting runs the cycle: a whole robot in one thread, as fast as it goes."""

from __future__ import annotations

from collections.abc import Callable

from robotd.clock import NANOSECONDS


class SteppedClock:
    """Simulated time. Whoever sleeps on it lives through the periods of the cycle meanwhile.

    The same calls give the same values, at any speed of the computer. For one thread at a time,
    and for devices that have no other time (``Bench.lives_by_clock``).

    Attributes:
        step: one period, given its nominal time (``Cycle.step``).
    """

    def __init__(self, rate_hz: float) -> None:
        self.period_ns = round(NANOSECONDS / rate_hz)
        self.step: Callable[[int], None] = lambda time_ns: None
        self._now_ns = NANOSECONDS
        self._due_ns = self._now_ns + self.period_ns
        self._stepping = False

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        if not self._stepping:
            self._run(deadline_ns)
        self._now_ns = max(self._now_ns, deadline_ns)

    def _run(self, deadline_ns: int) -> None:
        """The periods up to the deadline; those that a sleeping period missed are skipped."""
        self._stepping = True
        try:
            while self._due_ns <= deadline_ns:
                missed = max(0, self._now_ns - self._due_ns) // self.period_ns
                self._due_ns += missed * self.period_ns
                self._now_ns = max(self._now_ns, self._due_ns)
                self.step(self._due_ns)
                self._due_ns += self.period_ns
        finally:
            self._stepping = False
