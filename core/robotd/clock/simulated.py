"""Simulated time: it passes in whole periods of the cycle, and only there.

Between two periods it stands still. So however slow the computer is, no deadline is missed, and
the same commands at the same simulated times lead to the same motion, bit for bit, at any speed.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from robotd.clock import NANOSECONDS, Clock

START_NS = NANOSECONDS  # a time of 0 would mean "never"
_BEHIND_S = 0.1  # real time that a slow computer may make up for; the rest is dropped

Period = Callable[[int], int]


class Pace:
    """Holds simulated time to ``scale`` simulated seconds per second; infinity: no holding.

    For one thread. A computer that is too slow falls behind without a burst afterwards.
    """

    def __init__(self, scale: float) -> None:
        self.scale = scale
        self._origin_s = 0.0
        self._origin_ns = 0
        self._began = False

    def wait_for(self, time_ns: int) -> None:
        """Block until the simulated time ``time_ns`` may come."""
        if math.isinf(self.scale):
            return
        now_s = time.monotonic()
        due_s = self._origin_s + (time_ns - self._origin_ns) / NANOSECONDS / self.scale
        if not self._began or now_s - due_s > _BEHIND_S:
            self._began, self._origin_s, self._origin_ns = True, now_s, time_ns
        elif due_s > now_s:
            time.sleep(due_s - now_s)


class SteppedClock:
    """A clock on which waiting runs the cycle: a whole robot in one thread, without ROS.

    Whoever sleeps on it lives through the periods meanwhile. For one thread at a time, and for
    devices that have no other time. The cycle attaches itself when it starts.

    Args:
        scale: simulated seconds per second of real time; infinity: as fast as it goes.
    """

    def __init__(self, scale: float = math.inf) -> None:
        self._pace = Pace(scale)
        self._now_ns = START_NS
        self._due_ns = 0
        self._period: Period | None = None
        self._stepping = False

    def now_ns(self) -> int:
        return self._now_ns

    def attach(self, period_ns: int, period: Period) -> None:
        """Let ``period(due_ns)`` be called at every due time, ``period_ns`` from now at first.

        It answers when the next one is due.
        """
        self._due_ns, self._period = self._now_ns + period_ns, period

    def detach(self) -> None:
        """Time passes without periods again."""
        self._period = None

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Within a period: the period takes that long, and others are missed."""
        if not self._stepping:
            self._run(deadline_ns)
        self._now_ns = max(self._now_ns, deadline_ns)

    def _run(self, deadline_ns: int) -> None:
        self._stepping = True
        try:
            while self._period is not None and self._due_ns <= deadline_ns:
                self._pace.wait_for(self._due_ns)
                self._now_ns = max(self._now_ns, self._due_ns)
                self._due_ns = self._period(self._due_ns)
        finally:
            self._stepping = False


class PacedClock:
    """Simulated time for a robot whose cycle has a thread, as when it is served on ROS.

    The cycle takes ``leader``: its sleeping makes time pass. All others wait until time has
    passed. Any thread may call.

    Args:
        scale: as for ``SteppedClock``.

    Attributes:
        leader: the same time, for the cycle alone.
    """

    def __init__(self, scale: float = math.inf) -> None:
        self.scale = scale
        self.leader = _Leader(self)
        self._pace = Pace(scale)
        self._now_ns = START_NS
        self._limit_ns: int | None = None
        self._holds = self._sleepers = 0
        self._standing = False
        self._ended = False
        self._changed = threading.Condition()

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        with self._changed:
            self._sleepers += 1
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._ended or self._now_ns >= deadline_ns)
            self._sleepers -= 1

    @contextmanager
    def held(self) -> Iterator[None]:
        """Time stands while the block computes; whoever sleeps meanwhile lets it pass."""
        with self._changed:
            self._holds += 1
        try:
            yield
        finally:
            with self._changed:
                self._holds -= 1
                self._changed.notify_all()

    @property
    def paused(self) -> bool:
        """Time stands, or will stand at the end of the steps that are under way."""
        return self._limit_ns is not None

    def pause(self) -> None:
        """Let time stand from the next period on; not for a clock that has ended."""
        with self._changed:
            if not self._ended:
                self._limit_ns = self._now_ns
                self._changed.notify_all()

    def resume(self) -> None:
        """Let time pass again."""
        with self._changed:
            self._limit_ns = None
            self._changed.notify_all()

    def step(self, time_ns: int, timeout_s: float | None = None) -> bool:
        """Let ``time_ns`` pass, then stand; returns when its periods are over.

        Args:
            time_ns: simulated time, on top of steps that are still under way.
            timeout_s: real time to wait; None: for ever.

        Returns:
            False when the periods are not over by then; they go on.
        """
        with self._changed:
            if self._ended:
                return True
            limit_ns = (self._now_ns if self._limit_ns is None else self._limit_ns) + time_ns
            self._limit_ns, self._standing = limit_ns, False
            self._changed.notify_all()
            return self._changed.wait_for(
                lambda: self._ended or self._limit_ns != limit_ns or self._standing, timeout_s
            )

    def end(self) -> None:
        """The cycle is gone: nobody waits any more, now or later. Twice is not an error."""
        with self._changed:
            self._ended, self._limit_ns = True, None
            self._changed.notify_all()

    def _lead(self, deadline_ns: int) -> None:
        self._pace.wait_for(deadline_ns)
        with self._changed:
            while not self._may_pass(deadline_ns):
                self._changed.wait()
            self._now_ns = max(self._now_ns, deadline_ns)
            self._changed.notify_all()

    def _may_pass(self, time_ns: int) -> bool:
        """Lock held, cycle."""
        if self._limit_ns is not None and time_ns > self._limit_ns:
            self._standing = True
            self._changed.notify_all()
            return False
        return self._holds == 0 or self._sleepers > 0


class _Leader:
    """What the cycle has of a ``PacedClock``."""

    def __init__(self, clock: PacedClock) -> None:
        self._clock = clock
        self.now_ns = clock.now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self._clock._lead(deadline_ns)  # noqa: SLF001 - the two are one


SimulatedClock = SteppedClock | PacedClock


def held(clock: Clock) -> AbstractContextManager[None]:
    """``clock.held()`` where the clock has that: computing takes no simulated time."""
    return clock.held() if isinstance(clock, PacedClock) else nullcontext()
