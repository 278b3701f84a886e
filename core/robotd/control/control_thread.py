"""Thread of the control loop, and the watchdog of its periods."""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable

from robotd.clock import Clock, MonotonicClock
from robotd.control.watchdog import Watchdog, place_of
from robotd.log import get_logger
from robotd.realtime import request_realtime

log = get_logger("control")

PR_SET_TIMERSLACK = 29  # linux/prctl.h
STOP_S = 2.0  # time-out for the current period; a thread that hangs is abandoned
SWITCH_INTERVAL_S = 1e-4  # longest wait for a Python thread that holds the interpreter


class ControlThread:
    """Thread ``robotd-control``: runs a period at each deadline until it is stopped.

    Args:
        clock: of the deadlines.
        period_ns: between the start and the first deadline.
        period: runs the period of a deadline that has come; returns the next deadline.
        hang: called with the reason by the watchdog's thread when a period does not end.
        limit_s: duration after which a period hangs, in real time.
        realtime_priority: SCHED_FIFO priority to ask for, 1..99; 0 asks for none.

    Attributes:
        realtime: SCHED_FIFO was granted.
    """

    def __init__(
        self,
        clock: Clock,
        period_ns: int,
        period: Callable[[int], int],
        hang: Callable[[str], None],
        limit_s: float,
        realtime_priority: int,
    ) -> None:
        self.realtime = False
        self._clock, self._period_ns, self._period = clock, period_ns, period
        self._priority = realtime_priority
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._began_ns = 0  # in real time: simulated time stops while a driver hangs
        self._watchdog = Watchdog(self.age_ns, lambda: place_of(self._thread), limit_s, hang)

    def start(self) -> None:
        """Start the thread; no effect while it runs. Not again after ``stop``."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-control", daemon=True)
            self._thread.start()
            self._watchdog.start()

    def stop(self) -> None:
        """End the thread after its period and wait; a second call has no effect."""
        self._stop.set()
        self._watchdog.stop()
        if self._thread is not None:
            self._thread.join(STOP_S)
            if self._thread.is_alive():
                log.error("the control loop hangs; its thread is abandoned")

    def begin_work(self) -> None:
        """Begin to watch a period."""
        self._began_ns = MonotonicClock.now_ns()

    def end_work(self) -> None:
        """Stop watching: the thread may wait now."""
        self._began_ns = 0

    def age_ns(self) -> int:
        """Return the age of the watched period in real time; 0: none. Any thread."""
        began_ns = self._began_ns
        return MonotonicClock.now_ns() - began_ns if began_ns else 0

    def _run(self) -> None:
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
        self.realtime = request_realtime(self._priority)
        deadline_ns = self._clock.now_ns() + self._period_ns
        while not self._stop.is_set():
            self._clock.sleep_until_ns(deadline_ns)
            deadline_ns = self._period(deadline_ns)
