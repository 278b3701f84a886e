"""Stepped clock of a robot with a base, whose thread waits for the time of the main thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

from robotd.clock.simulated import SteppedClock
from robotd.control.groups.mobile_base import MobileBase
from robotd.robot import Robot

REAL_TIMEOUT_S = 60.0  # for the thread of the base, on a busy computer
LOCKED_S = 0.5  # after which a driver call of it waits for another one, which waits for time
POLL_S = 1e-5
BASE = "robotd-base"
CALLS = {"robotd-begin_stream", "robotd-end_stream"}  # threads of driver calls that the base makes


class BaseClock(SteppedClock):
    """Runs periods in the sleeps of the main thread; those of the base's thread wait for it.

    Between two periods, and after a sleep, the base's thread has done all that it can do at that
    time, so a sequence of commands leads to the same motion in every run.

    Attributes:
        before_period: called before each period, as a client between two periods.
    """

    def __init__(self) -> None:
        super().__init__()
        self.before_period: Callable[[], None] = lambda: None
        self._base: MobileBase | None = None
        self._asleep_ns: int | None = None  # until when the base's thread sleeps
        self._ending = False
        self._turn = threading.Condition()
        self._leader = 0  # thread in which time advances now, or which waits for the base

    def guide(self, robot: Robot) -> None:
        """Wait for the thread of the robot's base from now on."""
        base = self._base = robot.base
        assert base is not None
        self._ending = False  # of the robot before
        robot.axes._lock = _SteppedLock(self, robot.control_loop.period_ns)  # type: ignore[assignment]
        close = base.close

        def closing() -> None:
            self._ending = True
            self.settle()
            close()

        base.close = closing  # type: ignore[method-assign]

    def sleep_until_ns(self, deadline_ns: int) -> None:
        if not self.is_of_base:
            super().sleep_until_ns(deadline_ns)
            if not self._stepping:
                self.settle()
            return
        with self._turn:
            self._asleep_ns = deadline_ns
            self._turn.wait_for(lambda: self._ending or self._now_ns >= deadline_ns)
            self._asleep_ns = None
            if self._ending:
                self._now_ns = max(self._now_ns, deadline_ns)

    @property
    def is_of_base(self) -> bool:
        """The current thread is the base's, or does a driver call for it."""
        name = threading.current_thread().name
        return name == BASE or (name in CALLS and self._leader not in {0, threading.get_ident()})

    def settle(self) -> None:
        """Wait until the base's thread waits for something."""
        before, self._leader = self._leader, threading.get_ident()
        try:
            self._settle()
        finally:
            self._leader = before

    def _settle(self) -> None:
        with self._turn:
            self._turn.notify_all()
        began_s = time.monotonic()
        while not self._waits():
            passed_s = time.monotonic() - began_s
            assert passed_s < REAL_TIMEOUT_S, "the thread of the base hangs"
            if passed_s > LOCKED_S and self._calls_driver():
                return
            time.sleep(POLL_S)

    def _calls_driver(self) -> bool:
        return any(thread.name in CALLS for thread in threading.enumerate())

    def _waits(self) -> bool:
        base, asleep_ns = self._base, self._asleep_ns
        if base is None or self._ending or base.moving or base._worker.settled:
            return True
        return asleep_ns is not None and asleep_ns > self._now_ns

    def _run(self, deadline_ns: int) -> None:
        self._stepping, self._leader = True, threading.get_ident()
        try:
            while self._period is not None and self._due_ns <= deadline_ns:
                self._now_ns = max(self._now_ns, self._due_ns)
                self.settle()
                self.before_period()
                self.settle()
                self._due_ns = self._period(self._due_ns)
                self.settle()
        finally:
            self._stepping, self._leader = False, 0


class _SteppedLock:
    """Lock of the axes: while the other thread holds it, time goes on."""

    def __init__(self, clock: BaseClock, period_ns: int) -> None:
        self._clock, self._period_ns, self._lock = clock, period_ns, threading.RLock()

    def __enter__(self) -> None:
        while not self._lock.acquire(blocking=False):
            self._clock.sleep_until_ns(self._clock.now_ns() + self._period_ns)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._lock.release()
