"""Simulated time for a backend with a thread of its own: one thread runs, the others wait for it.

The thread that sleeps on the clock leads; the bus thread runs within its sleeps, when it is due. So
a sequence of commands leads to the same run on any computer.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

from tests.witness.bench import WitnessClock

from robotd.clock import NANOSECONDS

REAL_TIMEOUT_S = 60.0  # for the bus thread, on a busy computer
POLL_NS = NANOSECONDS // 1000


class ServoClock(WitnessClock):
    """Runs control periods, and the bus thread, in the sleeps of all other threads."""

    def __init__(self) -> None:
        super().__init__()
        self._turn = threading.Condition()
        self._wake_ns: int | None = None  # when the bus thread is due; None: there is none
        self._runs = self._killed = False

    @property
    def threading(self) -> SimpleNamespace:
        """The module, with threads and events in this time."""
        names = {"Thread": self._make_thread, "Event": lambda: ClockEvent(self)}
        return SimpleNamespace(**vars(threading) | names)

    def _make_thread(self, target: Callable[[], None], name: str, **_: Any) -> BusThread:
        return BusThread(self, target, name)

    def sleep_until_ns(self, deadline_ns: int) -> None:
        if isinstance(threading.current_thread(), BusThread):
            self.park(deadline_ns)
        else:
            super().sleep_until_ns(deadline_ns)

    def _run(self, deadline_ns: int) -> None:
        self._stepping = True
        try:
            while True:
                due_ns = self._due_ns if self._period is not None else None
                times = [time for time in (self._wake_ns, due_ns) if time is not None]
                if not times or min(times) > deadline_ns:
                    return
                self._now_ns = max(self._now_ns, min(times))
                if self._wake_ns == min(times):
                    self.resume_bus()
                elif self._period is not None:
                    self._due_ns = self._period(self._due_ns)
        finally:
            self._stepping = False

    def park(self, deadline_ns: int) -> None:
        """Wait for ``deadline_ns``. Bus thread."""
        with self._turn:
            self._wake_ns, self._runs = max(deadline_ns, self._now_ns), False
            self._turn.notify_all()
            self._turn.wait_for(lambda: self._runs)
            self._wake_ns = None
        if self._killed:
            raise SystemExit

    def resume_bus(self) -> None:
        """Let the bus thread run until it waits for time again, or ends."""
        with self._turn:
            self._runs = True
            self._turn.notify_all()
            self.wait_for_bus()

    def wait_for_bus(self) -> None:
        with self._turn:
            waits = self._turn.wait_for(lambda: not self._runs, REAL_TIMEOUT_S)
        assert waits, "the bus thread hangs"

    def begin_bus(self) -> None:
        """Note that a bus thread starts."""
        self._runs, self._killed = True, False

    def leave(self) -> None:
        """Note that the bus thread has ended."""
        with self._turn:
            self._wake_ns, self._runs = None, False
            self._turn.notify_all()

    def kill_bus(self) -> None:
        """End the bus thread where it is, as the end of its process does."""
        self._killed = True
        while self._wake_ns is not None:  # what it does at its end waits as well
            self.resume_bus()


class BusThread(threading.Thread):
    """Thread that runs when the clock lets it."""

    def __init__(self, clock: ServoClock, target: Callable[[], None], name: str) -> None:
        super().__init__(target=target, name=name, daemon=True)
        self._clock, self._ended = clock, False

    def start(self) -> None:
        self._clock.begin_bus()
        super().start()
        self._clock.wait_for_bus()

    def run(self) -> None:
        try:
            with suppress(SystemExit):  # it was killed
                self._clock.park(self._clock.now_ns())
                super().run()
        finally:
            self._ended = True
            self._clock.leave()

    def join(self, timeout: float | None = None) -> None:
        clock = self._clock
        end_ns = clock.now_ns() + round((timeout or REAL_TIMEOUT_S) * NANOSECONDS)
        while not self._ended and clock.now_ns() < end_ns:
            clock.sleep_until_ns(clock.now_ns() + POLL_NS)
        super().join(REAL_TIMEOUT_S if self._ended else 0.0)


class ClockEvent:
    """Event whose time-outs are in the time of a clock."""

    def __init__(self, clock: ServoClock) -> None:
        self._clock, self._set = clock, False

    def is_set(self) -> bool:
        return self._set

    def set(self) -> None:
        self._set = True

    def wait(self, timeout: float) -> bool:
        clock = self._clock
        end_ns = clock.now_ns() + round(timeout * NANOSECONDS)
        while not self._set and clock.now_ns() < end_ns:
            clock.sleep_until_ns(min(end_ns, clock.now_ns() + POLL_NS))
        return self._set
