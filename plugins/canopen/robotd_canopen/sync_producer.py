"""Producer of SYNC and of the master's heartbeat, with the nominal time of each SYNC."""

from __future__ import annotations

from robotd.api import NANOSECONDS, Clock
from robotd_canopen.bus import Bus
from robotd_canopen.frame import Frame
from robotd_canopen.nmt import NmtState
from robotd_cia402.sync_timing import SyncTiming

_SYNC, _HEARTBEAT = 0x080, 0x700


class SyncProducer:
    """Sends SYNC and, when it is due, the master's heartbeat. Control loop.

    Drives lock their clocks to SYNC, so their reports belong to the nominal times of the SYNCs,
    not to the jittered times at which this computer sent them.

    Attributes:
        count: SYNCs sent.
        timing: nominal time of the last SYNC, monotonic.
        before_ns: nominal time of the one before; 0 without one.
        periods: whole periods from the SYNC before to the last one: above 1 if some were skipped, 0
            for one close behind a late one.
        jitter_ns: largest deviation of the distance of two SYNCs from the period.
    """

    def __init__(
        self, bus: Bus, clock: Clock, period_s: float, heartbeat_s: float, master_node: int
    ) -> None:
        self.count = self.before_ns = self.jitter_ns = 0
        self.periods = 1
        self._bus, self._clock = bus, clock
        self.timing = SyncTiming(round(period_s * NANOSECONDS))
        self._heartbeat_ns = round(heartbeat_s * NANOSECONDS)
        self._heartbeat_due_ns = self._sent_ns = 0
        self._sync_frame = Frame(_SYNC, b"")
        self._heartbeat_frame = Frame(_HEARTBEAT + master_node, bytes([NmtState.OPERATIONAL]))

    def begin(self) -> None:
        """Worker: communication starts; do not count the pause before as jitter."""
        self._sent_ns = 0

    def send(self) -> None:
        """Send SYNC, and the heartbeat if it is due.

        A process may be stopped before the kernel has the frame, or right after. The time is taken
        before: the drives then count for moving, because a setpoint that drives at rest execute is
        better than one withheld from drives that move, which would go back to the one before.
        """
        self._clock.sleep_until_ns(self.timing.clear_ns(self._clock.now_ns()))
        now_ns = self._clock.now_ns()
        self._bus.send(self._sync_frame)
        self._note(now_ns)
        if now_ns >= self._heartbeat_due_ns:
            self._heartbeat_due_ns = now_ns + self._heartbeat_ns
            self._bus.send(self._heartbeat_frame)
            self._bus.measure_load(now_ns)

    def _note(self, now_ns: int) -> None:
        if self._sent_ns:
            deviation_ns = abs(now_ns - self._sent_ns - self.timing.period_ns)
            self.jitter_ns = max(self.jitter_ns, deviation_ns)
        self._sent_ns = now_ns
        self.count += 1
        self.before_ns = self.timing.time_ns
        self.periods = self.timing.note_event(now_ns)
