"""Distributed clocks, as the process data show them, and how the control loop follows them."""

from __future__ import annotations

from robotd.api import NANOSECONDS
from robotd_ethercat.soem import Soem

_FEATURES, _HAS_CLOCK = 0x0008, 1 << 2  # ESC features supported (ETG.1000.4, table 31)
_WINDOW_NS = NANOSECONDS  # of the range of the phase, and between two values of the drift
_BASE_NS = 60 * NANOSECONDS  # over which the drift is measured: frames are late by chance
_NEAR = 32  # 1/32 of a period around the middle
_COARSE, _FINE = 200, 2000  # steps: 0.5 % of a period, and 500 ppm, far above the drift of clocks


def slaves_with_clocks(bus: Soem, slaves: list[int]) -> list[int]:
    """Return those of ``slaves`` that have a distributed clock. Raises DeviceTimeout."""
    return [one for one in slaves if bus.read_register(one, _FEATURES, 1)[0] & _HAS_CLOCK]


class ClockObserver:
    """Phase and drift of the bus time, as observed with the process data. Control loop.

    From the phase it derives the shift that makes the control loop follow the reference clock.

    Attributes:
        phase_ns: passage of the last frame at the reference clock, after its SYNC0; 0 to period.
        lowest_ns, highest_ns: of the phase, in the window that ended last.
        drift_ppm: of the bus time against the clock of this computer, over up to a minute;
            positive: the bus is faster.
    """

    def __init__(self, period_ns: int, shift_ns: int) -> None:
        self._period_ns, self._shift_ns = period_ns, shift_ns
        self.begin()

    def begin(self) -> None:
        """Worker: forget what was observed."""
        self.phase_ns = self.lowest_ns = self.highest_ns = 0
        self.drift_ppm = 0.0
        self._bus_ns = self._own_ns = self._window_ns = 0
        self._lowest_ns, self._highest_ns = self._period_ns, 0
        self._near = False  # a frame has come near the middle

    @property
    def shift_ns(self) -> int:
        """Shift of the next period that brings the frames towards the middle between two SYNC0.

        In steps whose size does not depend on the distance: a frame that is late by chance counts
        no more than another. Until the first frame near it the periods only get shorter: longer
        ones would look like late frames.
        """
        if not self._near:
            return -self._period_ns // _COARSE
        fine_ns = self._period_ns // _FINE
        return -fine_ns if self.phase_ns > self._period_ns // 2 else fine_ns

    def observe(self, bus_ns: int, own_ns: int) -> None:
        """Note the bus time of a frame, sent at the monotonic time ``own_ns``."""
        self.phase_ns = phase_ns = (bus_ns - self._shift_ns) % self._period_ns
        self._lowest_ns = min(self._lowest_ns, phase_ns)
        self._highest_ns = max(self._highest_ns, phase_ns)
        self._near |= abs(phase_ns - self._period_ns // 2) <= self._period_ns // _NEAR
        if not self._own_ns:
            self._bus_ns, self._own_ns, self._window_ns = bus_ns, own_ns, own_ns
        elif own_ns - self._window_ns >= _WINDOW_NS:
            self._end_window(bus_ns, own_ns)

    def _end_window(self, bus_ns: int, own_ns: int) -> None:
        elapsed_ns, self._window_ns = own_ns - self._own_ns, own_ns
        self.drift_ppm = 1e6 * ((bus_ns - self._bus_ns) / elapsed_ns - 1)
        self.lowest_ns, self.highest_ns = self._lowest_ns, self._highest_ns
        self._lowest_ns, self._highest_ns = self._period_ns, 0
        if elapsed_ns >= _BASE_NS:
            self._bus_ns, self._own_ns = bus_ns, own_ns
