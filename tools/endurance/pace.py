"""An even rate for a loop that is to end."""

from __future__ import annotations

import threading
import time

BEHIND_S = 0.1


class Pace:
    """``wait`` returns ``rate_hz`` times a second; what is more than ``BEHIND_S`` late is lost."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._due_s = time.monotonic()

    def wait(self, ended: threading.Event) -> bool:
        """False when the loop is to end."""
        now_s = time.monotonic()
        self._due_s = max(self._due_s + self._period_s, now_s - BEHIND_S)
        return not ended.wait(max(0.0, self._due_s - now_s))
