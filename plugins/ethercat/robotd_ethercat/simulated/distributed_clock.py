"""Distributed clock of a slave controller: local time, system time, drift control, SYNC0."""

from __future__ import annotations

from robotd_ethercat.simulated import registers as reg

_PHASE_GAIN, _RATE_GAIN = 0.25, 0.02
_MAX_RATE = 500e-6  # what the control loop can correct
_OTHER_TIME_NS = 10_000_000  # a larger difference is another time base, taken over at once
_SIGN = 0x8000_0000
_SYNC0_ON = 0x03
_MASK_32, _MASK_64 = 0xFFFF_FFFF, 0xFFFF_FFFF_FFFF_FFFF


class DistributedClock:
    """Clock with a rate error, controlled by the system times that the master distributes.

    All times are ns. ``now_ns`` is the true time; the clock runs at ``1 + drift`` of it.

    Attributes:
        drift: rate error, 1e-6 is 1 ppm; change it by ``set_drift``.
        difference_ns: last received system time minus its own; None: none was received.
        received: last system time of the reference clock as it came, and its arrival.
        sync0: whether SYNC0 pulses come out, a fault if False while activated.
    """

    def __init__(self, memory: bytearray, now_ns: int) -> None:
        self._memory = memory
        self._base_ns, self._local = now_ns, 0.0
        self.drift = 0.0
        self._correction = 0.0
        self._shift = 0.0
        self.difference_ns: int | None = None
        self.received: tuple[bytes, int] | None = None
        self.sync0 = True

    def settle(self) -> None:
        """Compare the last received system time with the own one."""
        if self.received is not None:
            (data, arrival_ns), self.received = self.received, None
            self.compare(int.from_bytes(data, "little"), 8 * len(data), arrival_ns)

    def set_drift(self, drift: float, now_ns: int) -> None:
        """Change the rate error; the time does not jump."""
        self._local, self._base_ns = self._free(now_ns), now_ns
        self.drift = drift

    def local_time(self, now_ns: int) -> int:
        """Time since power-on, as the clock shows it without the drift control."""
        return round(self._free(now_ns)) & _MASK_64

    def system_time(self, now_ns: int) -> int:
        """Local time with offset and drift control."""
        return (round(self._free(now_ns) + self._shift) + self._offset) & _MASK_64

    def latch(self, now_ns: int, port_times: dict[int, int]) -> None:
        """Store the receive times of a frame: at the processing unit and at the ports."""
        self._put(reg.DC_PROCESSING_UNIT_TIME, 8, self.local_time(now_ns))
        for port, arrival_ns in port_times.items():
            address = reg.DC_RECEIVE_TIMES + 4 * port
            self._put(address, 4, self.local_time(arrival_ns) & _MASK_32)

    def refresh(self, now_ns: int) -> None:
        """Bring the system time register up to date before it is read."""
        self._put(reg.DC_SYSTEM_TIME, 8, self.system_time(now_ns))

    def compare(self, received: int, bits: int, now_ns: int) -> None:
        """Take a system time of the reference clock: difference register and drift control."""
        delay = int.from_bytes(self._memory[reg.DC_DELAY : reg.DC_DELAY + 4], "little")
        own = self.system_time(now_ns)
        half = 1 << bits - 1
        difference = (received + delay - own + half) % (1 << bits) - half
        self.difference_ns = difference
        size = min(abs(difference), _SIGN - 1)
        self._put(reg.DC_DIFFERENCE, 4, size | (_SIGN if difference < 0 else 0))
        if abs(difference) > _OTHER_TIME_NS:
            if bits == 64:
                self._shift += difference
                self.difference_ns = 0
            return
        elapsed_ns = min(now_ns - self._base_ns, 10_000_000)
        self._local, self._base_ns = self._free(now_ns), now_ns
        if elapsed_ns > 0:
            correction = self._correction + _RATE_GAIN * difference / max(elapsed_ns, 100_000)
            self._correction = min(max(correction, -_MAX_RATE), _MAX_RATE)
        limit = _MAX_RATE * max(elapsed_ns, 0)
        self._shift += min(max(_PHASE_GAIN * difference, -limit), limit)

    def sync0_count(self, now_ns: int) -> int | None:
        """Number of SYNC0 pulses since the start time; None without SYNC0."""
        cycle = self.sync0_cycle_ns
        if not (self._sync0_active and self.sync0 and cycle):
            return None
        start = int.from_bytes(self._memory[reg.DC_START_TIME : reg.DC_START_TIME + 8], "little")
        return (self.system_time(now_ns) - start) // cycle

    @property
    def sync0_active(self) -> bool:
        """True if the master activated SYNC0."""
        return self._sync0_active

    @property
    def sync0_cycle_ns(self) -> int:
        """Period of SYNC0, 0 if it is not set."""
        area = self._memory[reg.DC_SYNC0_CYCLE : reg.DC_SYNC0_CYCLE + 4]
        return int.from_bytes(area, "little")

    @property
    def _sync0_active(self) -> bool:
        return self._memory[reg.DC_ACTIVATION] & _SYNC0_ON == _SYNC0_ON

    @property
    def _offset(self) -> int:
        return int.from_bytes(self._memory[reg.DC_OFFSET : reg.DC_OFFSET + 8], "little")

    def _free(self, now_ns: int) -> float:
        rate = 1.0 + self.drift + self._correction
        return self._local + (now_ns - self._base_ns) * rate

    def _put(self, address: int, length: int, value: int) -> None:
        self._memory[address : address + length] = value.to_bytes(length, "little")
