"""Looks after the cycle: a driver that never returns from ``read`` must not look alive."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robotd.clock import NANOSECONDS
from robotd.log import get_logger

log = get_logger("watchdog")

HANG_S = 1.0  # a busy computer may delay a period by tenths of a second: that is no hang
SIMULATED_HANG_S = 5.0  # nothing real moves: rather late than a run that depends on the computer
CHECKS = 4  # looks within the time that a period may take


class Watchdog:
    """A thread of its own, ``robotd-watchdog``, that the cycle cannot hold up.

    Args:
        age_ns: for how long the present period of the cycle has been under way, in real time
            whatever the cycle's clock is; 0: none is.
        limit_s: the longest that a period may take; it is granted ``HANG_S`` in any case.
        hang: called when a period takes longer, with the reason; once for each such period.
    """

    def __init__(
        self, age_ns: Callable[[], int], limit_s: float, hang: Callable[[str], None]
    ) -> None:
        self._age_ns = age_ns
        self._limit_s = max(limit_s, HANG_S)
        self._hang = hang
        self._hanging = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        self._thread = threading.Thread(target=self._run, name="robotd-watchdog", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread. It is not waited for longer than a look takes."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(self._limit_s)

    def look(self) -> None:
        """Judge the period that is under way."""
        age_s = self._age_ns() / NANOSECONDS
        if age_s <= self._limit_s:
            self._hanging = False
        elif not self._hanging:
            self._hanging = True
            reason = f"the cycle hangs: a period takes longer than {self._limit_s:g} s"
            log.error("the cycle hangs", for_s=round(age_s, 3))
            self._hang(reason)

    def _run(self) -> None:
        while not self._stop.wait(self._limit_s / CHECKS):
            try:
                self.look()
            except Exception:
                log.exception("what a hanging cycle calls for failed")
