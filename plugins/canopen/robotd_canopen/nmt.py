"""Network management (NMT): states, commands, heartbeats, and signs of a duplicate node id."""

from __future__ import annotations

from enum import IntEnum

from robotd.api import NANOSECONDS

ANSWERS = "duplicate node id: received more SDO responses than requests"
FRAMES = "duplicate node id: {} comes more often than SYNC"
HEARTBEATS = "heartbeats come more than once in each period: probably a duplicate node id"
_WINDOW = 20  # heartbeat periods in which heartbeats are counted
_MAX_RATE = 1.6  # heartbeats for each period; above half of twice as many, below twice as many
_WINDOWS = 2  # in a row: after a stall of this computer, waiting ones come in one of them


class NmtState(IntEnum):
    """States as a heartbeat reports them (CiA 301, 7.2.8.3.2)."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127
    UNKNOWN = 255  # never sent: no heartbeat has been received


class NmtCommand(IntEnum):
    """Commands of the NMT master (CiA 301, 7.2.8.3.1)."""

    START = 1
    STOP = 2
    PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


def heartbeat_state(data: bytes | bytearray) -> NmtState:
    """State in a heartbeat frame, toggle bit ignored. Raises ValueError for anything else."""
    if len(data) != 1:
        raise ValueError(f"a heartbeat has 1 byte, this one {len(data)}")
    return NmtState(data[0] & 0x7F)


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
