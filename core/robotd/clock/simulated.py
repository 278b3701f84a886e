"""Simulated clocks: time advances in whole periods of the control loop.

Between two periods it does not advance. However slow the computer is, no deadline is missed, and
the same commands at the same simulated times lead to the same motion, bit for bit, at any speed.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass

from robotd.clock import NANOSECONDS, Clock

START_NS = NANOSECONDS  # a time of 0 would mean "never"
_MAX_CATCH_UP_S = 0.1  # real time that a slow computer may catch up; more is dropped

Period = Callable[[int], int]


class Pace:
    """Paces simulated time at ``scale`` simulated seconds per second; infinity: unpaced.

    For one thread. A computer that is too slow falls behind without a burst afterwards.
    """

    def __init__(self, scale: float) -> None:
        self.scale = scale
        self._origin_s = 0.0
        self._origin_ns = 0
        self._began = False

    def wait_for(self, time_ns: int) -> None:
        """Block until the simulated time ``time_ns`` is due in real time."""
        if math.isinf(self.scale):
            return
        now_s = time.monotonic()
        due_s = self._origin_s + (time_ns - self._origin_ns) / NANOSECONDS / self.scale
        if not self._began or now_s - due_s > _MAX_CATCH_UP_S:
            self._began, self._origin_s, self._origin_ns = True, now_s, time_ns
        elif due_s > now_s:
            time.sleep(due_s - now_s)


class SteppedClock:
    """Clock for a whole robot in one thread, without ROS: sleeping runs control periods.

    Sleeping on it runs the control periods that fall into the interval. For one thread at a time,
    and for devices that use no other clock. The control loop attaches itself when it starts.

    Args:
        scale: simulated seconds per second of real time; infinity: as fast as possible.
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
        """Call ``period(due_ns)`` at every due time, first ``period_ns`` from now.

        It returns when the next one is due.
        """
        self._due_ns, self._period = self._now_ns + period_ns, period

    def detach(self) -> None:
        """Stop running periods; time still advances."""
        self._period = None

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Advance to ``deadline_ns``; within a period this makes the period overrun."""
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


@dataclass(eq=False)
class _Due:
    """Time of the next tick of one iterator."""

    time_ns: int
    reached: threading.Event | None = None  # set when time is held at it


class PacedClock:
    """Simulated time for a robot with a control thread, as with ROS nodes.

    The control loop uses ``leader``, whose sleeping advances time. All other threads wait for
    it. Any thread may call.

    Args:
        scale: as for ``SteppedClock``.

    Attributes:
        leader: the same time, for the control loop only.
    """

    def __init__(self, scale: float = math.inf) -> None:
        self.scale = scale
        self.leader = _Leader(self)
        self._pace = Pace(scale)
        self._now_ns = START_NS
        self._limit_ns: int | None = None
        self._holds = self._sleepers = 0
        self._dues: list[_Due] = []
        self._standing = False
        self._released = self._ended = False
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
    def ticks(self, event: threading.Event, period_ns: int) -> Iterator[Iterator[None]]:
        """Yield an iterator that ticks now and every ``period_ns`` until ``event`` is set.

        Time is held from a tick until the next one is asked for, so however slow the computer
        is, none is skipped. The event is one that the control loop sets, and seen at the end of
        the period. Nothing between two ticks may sleep on this clock.
        """
        with self._changed:  # before the first tick is asked for, time must not go on, either
            due = _Due(self._now_ns)
            self._dues.append(due)
        try:
            yield self._tick(due, event, period_ns)
        finally:
            with self._changed:
                self._dues.remove(due)
                self._changed.notify_all()

    def _tick(self, due: _Due, event: threading.Event, period_ns: int) -> Iterator[None]:
        while True:
            with self._changed:
                self._sleepers += 1
                self._changed.notify_all()
                self._changed.wait_for(
                    lambda: self._ended or event.is_set() or self._now_ns >= due.time_ns
                )
                self._sleepers -= 1
            if self._ended:
                event.wait()  # the control loop sets it at its end
            if event.is_set():
                return
            yield
            due.time_ns = max(due.time_ns + period_ns, self._now_ns)

    @contextmanager
    def bounded(self, ahead_ns: int, reached: threading.Event) -> Iterator[Callable[[], None]]:
        """Let time advance by ``ahead_ns``, and again with each call of the function yielded.

        Time is held then, with ``reached`` set: an observer that is slower than the simulation
        misses nothing. Unlike a tick it wakes no thread in each period. What is between two calls
        may not sleep on this clock.
        """
        with self._changed:
            due = _Due(self._now_ns + ahead_ns, reached)
            self._dues.append(due)

        def advance() -> None:
            with self._changed:
                due.time_ns = self._now_ns + ahead_ns
                self._changed.notify_all()

        try:
            yield advance
        finally:
            with self._changed:
                self._dues.remove(due)
                self._changed.notify_all()

    @contextmanager
    def untimed(self) -> Iterator[None]:
        """Pause time while the block computes; it advances while a thread sleeps on it."""
        with self._changed:
            self._holds += 1
        try:
            yield
        finally:
            with self._changed:
                self._holds -= 1
                self._changed.notify_all()

    def pause(self) -> None:
        """Pause time from the next period on; no effect after ``release``."""
        with self._changed:
            if not self._released:
                self._limit_ns = self._now_ns
                self._changed.notify_all()

    def resume(self) -> None:
        """Resume time."""
        with self._changed:
            self._limit_ns = None
            self._changed.notify_all()

    def release(self) -> None:
        """Resume time for good: what waits for it while the robot ends is not held up."""
        with self._changed:
            self._released, self._limit_ns = True, None
            self._changed.notify_all()

    def step(self, time_ns: int, timeout_s: float | None = None) -> bool:
        """Advance by ``time_ns``, then pause; return when its periods have run.

        No effect after ``release``.

        Args:
            time_ns: simulated time, on top of steps that are still running.
            timeout_s: real time to wait; None: no limit.

        Returns:
            False when the periods have not run by then; they still will.
        """
        with self._changed:
            if self._released:
                return True
            limit_ns = (self._now_ns if self._limit_ns is None else self._limit_ns) + time_ns
            self._limit_ns, self._standing = limit_ns, False
            self._changed.notify_all()
            return self._changed.wait_for(
                lambda: self._ended or self._limit_ns != limit_ns or self._standing, timeout_s
            )

    def end(self) -> None:
        """Release all waiting threads, now and later. Idempotent."""
        with self._changed:
            self._released, self._ended, self._limit_ns = True, True, None
            self._changed.notify_all()

    def _lead(self, deadline_ns: int) -> None:
        self._pace.wait_for(deadline_ns)
        with self._changed:
            while not self._may_pass(deadline_ns):
                self._changed.wait()
            self._now_ns = max(self._now_ns, deadline_ns)
            self._changed.notify_all()

    def _may_pass(self, time_ns: int) -> bool:
        """Return True when time may advance to ``time_ns``; the lock is held."""
        if self._limit_ns is not None and time_ns > self._limit_ns:
            self._standing = True
            self._changed.notify_all()
            return False
        over = [due for due in self._dues if due.time_ns <= self._now_ns]
        if time_ns > self._now_ns and over:
            for due in over:
                if due.reached is not None:
                    due.reached.set()
            return False
        return self._holds == 0 or self._sleepers > 0


class _Leader:
    """The control loop's view of a ``PacedClock``."""

    def __init__(self, clock: PacedClock) -> None:
        self._clock = clock
        self.now_ns = clock.now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self._clock._lead(deadline_ns)  # noqa: SLF001 - the two are one


SimulatedClock = SteppedClock | PacedClock


@contextmanager
def ticks(event: threading.Event, period_ns: int, clock: Clock) -> Iterator[Iterator[None]]:
    """Yield an iterator that ticks now and every ``period_ns`` on ``clock`` until ``event`` is set.

    Where time is simulated, it is held from a tick until the next one is asked for.
    """
    if isinstance(clock, PacedClock):
        with clock.ticks(event, period_ns) as paced:
            yield paced
    else:
        yield _real_ticks(event, period_ns, clock)


def _real_ticks(event: threading.Event, period_ns: int, clock: Clock) -> Iterator[None]:
    due_ns = clock.now_ns()
    while not event.is_set():
        yield
        due_ns = max(due_ns + period_ns, clock.now_ns())
        event.wait((due_ns - clock.now_ns()) / NANOSECONDS)


@contextmanager
def bounded(clock: Clock, ahead_ns: int, reached: threading.Event) -> Iterator[Callable[[], None]]:
    """``clock.bounded(...)`` for a paced clock; other clocks need no bound: no effect."""
    if isinstance(clock, PacedClock):
        with clock.bounded(ahead_ns, reached) as advance:
            yield advance
    else:
        yield lambda: None


def untimed(clock: Clock) -> AbstractContextManager[None]:
    """Return ``clock.untimed()`` for a paced clock: computing takes no simulated time."""
    return clock.untimed() if isinstance(clock, PacedClock) else nullcontext()
