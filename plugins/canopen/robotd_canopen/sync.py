"""SYNC and the master's heartbeat: sent by the cycle, and the time that goes with them."""

from __future__ import annotations

from robotd_canopen.bus import Bus
from robotd_canopen.frame import Frame
from robotd_canopen.nmt import NmtState

NANOSECONDS = 1_000_000_000
_SYNC, _HEARTBEAT = 0x080, 0x700


class SyncProducer:
    """Sends SYNC and, every so often, the master's heartbeat. Cycle thread.

    Drives lock their clocks to SYNC, so what they report belongs to the even grid of the SYNCs,
    not to the moments at which a busy computer sent them. A SYNC is never early: the grid runs
    through those that were least late.

    Attributes:
        count: SYNCs sent.
        time_ns: time of the last SYNC on the grid, monotonic; 0 before the first.
        before_ns: that of the SYNC before, whose answers the cycle has when it sends the last.
        periods: whole periods from the SYNC before to the last one; above 1 some were left out.
        jitter_ns: largest deviation of the distance of two SYNCs from the period.
    """

    def __init__(self, bus: Bus, period_s: float, heartbeat_s: float, master_node: int) -> None:
        self.count = self.time_ns = self.before_ns = self.jitter_ns = 0
        self.periods = 1
        self._bus = bus
        self._period_ns = round(period_s * NANOSECONDS)
        self._heartbeat_ns = round(heartbeat_s * NANOSECONDS)
        self._heartbeat_due_ns = self._sent_ns = 0
        self._sync_frame = Frame(_SYNC, b"")
        self._heartbeat_frame = Frame(_HEARTBEAT + master_node, bytes([NmtState.OPERATIONAL]))

    def begin(self) -> None:
        """Worker: communication starts; the pause before is no jitter."""
        self._sent_ns = 0

    def send(self, now_ns: int) -> None:
        """A SYNC now, and the heartbeat if it is due."""
        self._bus.send(self._sync_frame)
        self._note(now_ns)
        if now_ns >= self._heartbeat_due_ns:
            self._heartbeat_due_ns = now_ns + self._heartbeat_ns
            self._bus.send(self._heartbeat_frame)
            self._bus.measure_load(now_ns)

    def _note(self, now_ns: int) -> None:
        if self._sent_ns:
            deviation_ns = abs(now_ns - self._sent_ns - self._period_ns)
            self.jitter_ns = max(self.jitter_ns, deviation_ns)
        self._sent_ns = now_ns
        self.count += 1
        self.before_ns = self.time_ns
        passed = (now_ns - self.time_ns) // self._period_ns
        self.time_ns = self.time_ns + passed * self._period_ns if passed else now_ns
        self.periods = max(1, passed)
