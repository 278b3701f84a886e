"""Bound on the frames that wait in an adapter which cannot discard them."""

from __future__ import annotations

CLOSING_SYNCS = 2  # unanswered; one is a late answer
PROBE_PERIODS = 8  # until the first probe; the next ones take twice as long each
MAX_PROBES = 16


class SyncGate:
    """Withholds SYNC and setpoints while no drive answers, and probes. Control loop.

    An adapter whose bus is blocked shows nothing: its frames wait, and the drives would execute
    them all at once when the bus is free. So after ``CLOSING_SYNCS`` unanswered SYNCs only these
    go out: SYNCs as probes, at most ``MAX_PROBES`` at growing intervals; and what takes away
    energy or speed, with a probe, or at once where it changes a controlword or halves a velocity.
    A frame that is received after a time without any begins the probes anew, at once.

    With the two SYNCs, three setpoints of each axis can wait at most: that of the second SYNC was
    sent before the first was due to be answered, and one more before the second was. A drive whose
    answers are late seems to answer SYNCs that wait: for each period of its delay one more can.

    Args:
        period_s: of SYNC.
        quiet_s: time without any received frame after which a frame means that the bus is back.

    Attributes:
        is_closed: SYNC and setpoints are withheld.
        sends: SYNC is sent in this period.
    """

    def __init__(self, period_s: float, quiet_s: float) -> None:
        self.is_closed, self.sends = False, True
        self._quiet_periods = quiet_s / period_s
        self._received = self._quiet = 0  # frames received, and periods without a new one
        self._left = self._interval = self._probes = 0  # periods until the next probe, and so on
        self._requested = False

    def advance(self, unanswered: int, received: int) -> None:
        """Begin one SYNC period.

        Args:
            unanswered: latest SYNCs in a row that no drive has answered.
            received: frames received since the bus was opened.
        """
        is_back = self._quiet > self._quiet_periods and received != self._received
        self._quiet = self._quiet + 1 if received == self._received else 0
        self._received = received
        if unanswered < CLOSING_SYNCS:
            self.is_closed, self._requested, self.sends = False, False, True
            return
        if not self.is_closed or is_back:
            self.is_closed, self._probes = True, 0
            self._interval = PROBE_PERIODS
            self._left = 1 if is_back else PROBE_PERIODS
        self._left -= 1
        self.sends = self._requested or self._left == 0
        self._requested = False
        if self._left == 0:
            self._probes += 1
            self._interval *= 2
            self._left = self._interval if self._probes < MAX_PROBES else 0  # it stays below 0

    def admits(self, *, at_once: bool) -> bool:
        """Return whether an RPDO may be sent now, for the next SYNC.

        Args:
            at_once: it takes away more than may wait for a probe. SYNC follows then.
        """
        if not self.is_closed or self._left == 1:
            return True
        self._requested |= at_once
        return at_once
