"""Stalls of the computer, which make a check in real time worthless."""

from __future__ import annotations

import threading
import time
from typing import Self

PERIOD_S = 0.005


class StallMonitor:
    """Longest stall of this process while the context is open.

    A thread sleeps and looks how late it wakes up. Processor time that other processes take is
    seen as well as time that a host takes from a virtual machine.

    Attributes:
        longest_s: how late the thread woke up at most.
    """

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="stall monitor", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _watch(self) -> None:
        before_s = time.monotonic()
        while not self._end.wait(PERIOD_S):
            now_s = time.monotonic()
            self.longest_s = max(self.longest_s, now_s - before_s - PERIOD_S)
            before_s = now_s
