"""Thread of a mobile base, for the calls that may block."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robotd.clock import Clock, wait_until


class BaseWorker:
    """Thread ``robotd-base``: runs ``move`` when a command wakes it. Any thread may call.

    Args:
        is_wanted: returns True while a command asks for motion.
        move: blocks until the motion has ended; must not raise.

    Attributes:
        closing: ``close`` was called.
    """

    def __init__(self, is_wanted: Callable[[], bool], move: Callable[[], None]) -> None:
        self.closing = False
        self._is_wanted, self._move = is_wanted, move
        self._wake = threading.Event()
        self._idle = threading.Event()
        self._idle.set()
        self._thread: threading.Thread | None = None

    @property
    def settled(self) -> bool:
        """No motion runs, and none was asked for."""
        return not self._wake.is_set() and self._idle.is_set()  # in the reverse order of `_run`

    def start(self) -> None:
        """Start the thread. A second call has no effect."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotd-base", daemon=True)
            self._thread.start()

    def wake(self) -> None:
        """Check whether motion is wanted; never blocks."""
        self._wake.set()

    def wait_idle(self, timeout_s: float, clock: Clock) -> bool:
        """Block until no motion runs; return False after ``timeout_s``."""
        return wait_until(self._idle.is_set, timeout_s, clock)

    def close(self) -> None:
        """End the thread after the motion, and wait; a second call has no effect."""
        self.closing = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while True:
            self._wake.wait()
            self._idle.clear()
            self._wake.clear()
            if self.closing:
                break
            if self._is_wanted():
                self._move()
            self._idle.set()
        self._idle.set()
