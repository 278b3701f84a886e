"""Cyclic exchange of process data of drives and modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from robotd.api import Clock
from robotd_ethercat.al_status import AlState
from robotd_ethercat.io_image import IoImage
from robotd_ethercat.slave import Slave
from robotd_ethercat.soem import NO_FRAME, SlaveState, Soem

_LIVE_TIMEOUT_US = 100  # the frame was seen to be here, or was sent a period ago and is lost
_FIRST_TIMEOUT_US = 2000
_SUSPECT_FRAMES = 16  # after a lost one; SOEM numbers its frames from 0 to 15
_LRW_OUTPUTS, _LRW_INPUTS = 2, 1  # working counter of a slave in one LRW datagram


@dataclass
class Counters:
    """Frames since the start or the last reset.

    Attributes:
        lost: frames that did not come back.
        incomplete: frames that not all slaves have processed.
    """

    sent: int = 0
    received: int = 0
    lost: int = 0
    incomplete: int = 0


class Exchange:
    """Process data of all slaves. Control loop; a worker while the bus is brought up.

    Attributes:
        frames: frames sent.
        good_frames: frames that came back from every slave that is online.
        bad_in_row: frames in a row, lost or incomplete.
        in_flight: a frame was sent and not received yet.
        blocked: the last frame is not back, and waits in the interface of this computer.
        suspect: number of frames from now on that may be late ones, after a loss.
        sent_ns: monotonic time at which the last frame was sent; the inputs were sampled then.
        needed: working counter of the slaves that are online, and of those in Op that are not in
            the descriptor.
        working_counter: of the last frame; -1 if it did not come back.
    """

    def __init__(self, bus: Soem, slaves: Sequence[Slave], io: IoImage, clock: Clock) -> None:
        self.frames = self.good_frames = self.bad_in_row = self.sent_ns = 0
        self.needed = 0
        self.working_counter = NO_FRAME
        self.counters = Counters()
        self._bus, self._slaves, self._io, self._clock = bus, slaves, io, clock
        self._drives: list[tuple[Slave, Any]] = []
        self.in_flight = self.blocked = False
        self.suspect = 0

    def begin(self) -> None:
        """Worker: the slaves are configured; send outputs of all, receive from all."""
        self._drives = [
            (slave, self._bus.slaves[slave.number]) for slave in self._slaves if slave.is_drive
        ]
        self._io.begin(self._bus.slaves)
        self.needed = self._bus.expected_counter
        self.in_flight = self.blocked = False
        self._forget_bad_frames()

    def go_live(self) -> None:
        """Worker: all slaves are in Op; the frames of bring-up do not count."""
        self.count_online(self._bus.states())
        self.counters = Counters()
        self._forget_bad_frames()

    def count_online(self, states: Sequence[SlaveState]) -> None:
        """Update ``needed`` after a slave was lost or has come back.

        Args:
            states: of all slaves on the bus. One that is not in the descriptor adds to the working
                counter in Op, and would hide the loss of one that is.
        """
        configured = {slave.number for slave in self._slaves}
        others = sum(
            full_counter(len(raw.output), len(raw.input))
            for number, (raw, found) in enumerate(zip(self._bus.slaves, states, strict=True))
            if number not in configured and found.state is AlState.OP
        )
        self.needed = others + sum(slave.counter for slave in self._slaves if slave.online)

    def expect(self, slave: Slave) -> None:
        """Count frames as good only if ``slave`` has processed them; it is not online yet."""
        self.needed += slave.counter

    def send(self) -> None:
        """Encode and send the outputs of all slaves.

        The time is taken right before: a process may be stopped while it encodes.
        """
        for slave, raw in self._drives:
            raw.output = slave.image.pack()
        self._io.pack()
        self.sent_ns, self.in_flight = self._clock.now_ns(), True
        self._bus.send()
        self.frames += 1
        self.counters.sent += 1

    def check_blocked(self) -> bool:
        """Return True, and count a lost frame, while the last one has not left this computer.

        What is sent then is executed late, and all of it at once. One frame can get late, because
        it is sent before the interface is known to be blocked.
        """
        self.blocked = self.working_counter <= 0 and self._bus.is_blocked
        if self.blocked:
            self.bad_in_row += 1
            self._note_missed(returned=False)
        return self.blocked

    def receive(self, timeout_us: int = _LIVE_TIMEOUT_US) -> bool:
        """Receive the last frame and decode the inputs; False: it is lost or incomplete.

        While frames are lost, the interpreter lock is released: the wait may take 4 ms.
        """
        self.in_flight = False
        counter = self._bus.receive(timeout_us, release_gil=self.bad_in_row > 0)
        if self.suspect and self._bus.drop_late_frames():
            counter = NO_FRAME  # with others behind it: it may be an old one of the same number
        self.suspect = _SUSPECT_FRAMES if counter <= 0 else max(0, self.suspect - 1)
        self.working_counter = counter
        if counter < self.needed or counter <= 0:
            self.bad_in_row += 1
            if counter <= 0:
                self.counters.lost += 1
            else:
                self.counters.incomplete += 1
            self._note_missed(returned=counter > 0)
            return False
        if self.bad_in_row:
            self._forget_bad_frames()
        self.counters.received += 1
        for slave, raw in self._drives:
            slave.image.take(raw.input)
        self._io.take()
        self.good_frames += 1
        return True

    def _forget_bad_frames(self) -> None:
        self.bad_in_row = 0
        for slave in self._slaves:
            slave.missed = 0

    def _note_missed(self, *, returned: bool) -> None:
        """Count the frame as missed by every drive, but for those that it shows the opposite of.

        Of a frame that returned incomplete, the working counter does not tell which slave has not
        processed it; that leaves its inputs as they were sent, as they came before. A drive whose
        inputs have changed has processed it.
        """
        for slave, raw in self._drives:
            slave.unreached = returned
            if returned and raw.input != slave.image.raw:
                slave.image.take(raw.input)
                slave.missed = 0
            else:
                slave.missed += 1

    def run_once(self) -> bool:
        """Worker: one frame there and back, while no control loop exchanges."""
        self.send()
        is_back = self.receive(_FIRST_TIMEOUT_US)
        if is_back:
            self._bus.note_all_sent()
        return is_back


def full_counter(output_size: int, input_size: int) -> int:
    """Return what an operational slave adds to the working counter; sizes in bytes."""
    return _LRW_OUTPUTS * bool(output_size) + _LRW_INPUTS * bool(input_size)
