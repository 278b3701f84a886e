"""Time-out of streamed setpoints."""

from __future__ import annotations

from collections.abc import Iterable

from robotd.api import NANOSECONDS, Clock


class StreamTimeout:
    """Time since the last setpoint, with a limit.

    ``restart`` may be called by any thread, ``problem`` by the control loop.
    """

    def __init__(self, clock: Clock, limit_s: float) -> None:
        self._clock, self._limit_s = clock, limit_s
        self._limit_ns = round(limit_s * NANOSECONDS)
        self._since_ns = 0

    def restart(self) -> int:
        """Restart at the present time, and return it (monotonic, ns)."""
        self._since_ns = self._clock.now_ns()
        return self._since_ns

    def problem(self, now_ns: int, streaming: Iterable[str]) -> str:
        """Return an error text with the names in ``streaming``; "" within the limit or without."""
        if now_ns - self._since_ns <= self._limit_ns:
            return ""
        names = ", ".join(dict.fromkeys(streaming))
        return f"{names}: no setpoint for {self._limit_s:g} s" if names else ""
