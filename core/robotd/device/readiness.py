"""Readiness of the device for commands, with listeners."""

from __future__ import annotations

import threading
from collections.abc import Callable

from robotd.device.state import ConnectionState
from robotd.log import get_logger

log = get_logger("connection")

ReadyListener = Callable[[bool], None]

ANSWER_S = 1.0  # longest wait for a device that another thread is asking for its state


class Readiness:
    """Flag with listeners, which are called one at a time, on every change. Any thread.

    Attributes:
        ready: axes can be commanded.
        prepared: communication was started by robotd, and the parameters are in force.
    """

    def __init__(self) -> None:
        self.ready = self.prepared = False
        self._listeners: list[ReadyListener] = []
        # One thread at a time: else an older answer of the device could overwrite a newer one.
        self._lock = threading.RLock()

    def add(self, listener: ReadyListener) -> None:
        """Call ``listener(ready)`` now and on every change, from the thread that causes it."""
        with self._lock:
            self._listeners.append(listener)
            listener(self.ready)

    def update(self, ask: Callable[[], ConnectionState]) -> ConnectionState:
        """Set ``ready`` by the state that ``ask`` returns; what a listener raises is logged.

        Returns the state; UNKNOWN, without effect, when another thread gets no answer.
        """
        if not self._lock.acquire(timeout=ANSWER_S):
            return ConnectionState.UNKNOWN
        try:
            state = ask()
            ready = state is ConnectionState.COMMUNICATING and self.prepared
            if ready is not self.ready:
                self._set(ready)
            return state
        finally:
            self._lock.release()

    def withdraw(self) -> None:
        """Set ``ready`` to False without the lock: its holder may hang."""
        if self.ready:
            self._set(False)

    def _set(self, ready: bool) -> None:
        self.ready = ready
        for listener in self._listeners:
            try:
                listener(ready)
            except Exception:
                log.exception("a listener of the engine failed", ready=ready)
