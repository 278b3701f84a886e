"""Signs that two nodes have one id, in answers and heartbeats."""

from __future__ import annotations

from robotd.api import NANOSECONDS

ANSWERS = "duplicate node id: received more SDO responses than requests"
FRAMES = "duplicate node id: {} comes more often than SYNC"
HEARTBEATS = "heartbeats come more than once in each period: probably a duplicate node id"
_WINDOW = 20  # heartbeat periods in which heartbeats are counted
_MAX_RATE = 1.6  # heartbeats for each period; above half of twice as many, below twice as many
_WINDOWS = 2  # in a row: after a stall of this computer, waiting ones come in one of them


class HeartbeatRate:
    """Finds nodes whose heartbeats come twice as often as they say. Control loop.

    Attributes:
        period_s: as the node reports it (object 0x1017); 0: not known, nothing is found.
    """

    def __init__(self) -> None:
        self.period_s = 0.0
        self._begun_ns = self._count = self._windows = 0

    def is_doubled(self, count: int, now_ns: int) -> bool:
        """Return True while too many of ``count`` heartbeats, since power-on, have come lately."""
        elapsed_s = (now_ns - self._begun_ns) / NANOSECONDS
        if not self.period_s or elapsed_s < _WINDOW * self.period_s:
            return self._windows >= _WINDOWS
        fast = count - self._count > _MAX_RATE * elapsed_s / self.period_s
        self._windows = self._windows + 1 if fast and self._begun_ns else 0
        self._begun_ns, self._count = now_ns, count
        return self._windows >= _WINDOWS
