"""Stand-in for the library pysoem: its interface, on a cable of independent slaves.

robotd reaches a bus through pysoem alone. This has the names that it calls, with the behaviour that
pysoem documents; slaves and cable behind it live in simulated time.
"""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from tests.plugins.independent.canopen_objects import Abort
from tests.witness.bench import STEP_S
from tests.witness.ethercat_slave import Al, EthercatSlave

NO_FRAME = -1
LRW, COMMAND, INDEX = 12, 16, 17  # the command, and where a frame has it and its number
QUEUE_FRAMES = 1000  # of the network interface: its txqueuelen
NUMBERS = 16  # of frames


class SdoError(Exception):
    def __init__(self, slave_pos: int, code: int) -> None:
        super().__init__(f"SDO abort {code:08X}")
        self.slave_pos, self.abort_code, self.desc = slave_pos, code, "aborted"


class WkcError(Exception):
    pass


class MailboxError(Exception):
    pass


class PacketError(Exception):
    pass


class ConfigMapError(Exception):
    error_list: tuple[Exception, ...] = ()


@dataclass
class Frame:
    """Process data on their way; ``outputs`` of each slave."""

    outputs: list[bytes]
    sent_s: float
    number: int


class Cable:
    """The slaves in line, and the faults of the way to them. Simulated time.

    Attributes:
        deaf_s: frames do not get to the slaves until then, and so do not come back.
        mute_s: frames do not come back until then.
        slow_s, delay_s: frames come back ``delay_s`` late, until ``slow_s``.
        cut_at: place before which the cable is cut; None: it is whole.
        blocked_s: the network interface sends nothing until then, and queues.
    """

    def __init__(self, now_s: Callable[[], float]) -> None:
        self.slaves: list[EthercatSlave] = []
        self.deaf_s = self.mute_s = self.slow_s = self.blocked_s = self.delay_s = 0.0
        self.cut_at: int | None = None
        self.now_s, self._last_s = now_s, now_s()
        self.sleep: Callable[[float], None] = lambda seconds: None  # of a thread, in this time
        self._queue: deque[Frame] = deque()
        self._late: deque[tuple[float, bytes]] = deque()  # when they come back, and the heads
        self._sent = 0
        self._contents: dict[int, tuple[list[bytes], int]] = {}  # of frames that come back
        self.master_end, self._our_end = _socket_pair()

    @property
    def reachable(self) -> list[EthercatSlave]:
        return self.slaves[: self.cut_at]

    def close(self) -> None:
        """Close both ends of what stands for the raw socket."""
        self.master_end.close()
        self._our_end.close()

    def answers(self, slave: EthercatSlave) -> bool:
        """Return whether an acyclic frame to a slave comes back."""
        now = self.now_s()
        on_way = now < self.deaf_s or now < self.mute_s or now < self.blocked_s
        return slave.addressed and slave in self.reachable and not on_way

    def advance(self) -> None:
        """Let the slaves live up to the present."""
        end_s = self.now_s()
        while self._last_s < end_s - 1e-9:
            self._last_s = min(end_s, self._last_s + STEP_S)
            if self._queue and self._last_s >= self.blocked_s:
                self._our_end.recv(1)
                while self._queue:
                    self._carry(self._queue.popleft(), self._last_s)
            while self._late and self._late[0][0] <= self._last_s:
                self._our_end.send(self._late.popleft()[1])
            for slave in self.slaves:
                slave.tick(self._last_s)

    def send(self, outputs: list[bytes]) -> None:
        self.advance()
        self._sent += 1
        frame = Frame(outputs, self.now_s(), self._sent)
        if frame.sent_s < self.blocked_s:
            if not self._queue:
                self.master_end.send(b"?")  # the kernel counts it as unsent until it is taken
            if len(self._queue) < QUEUE_FRAMES:
                self._queue.append(frame)
        else:
            self._carry(frame, frame.sent_s)

    def receive(self) -> tuple[list[bytes], int]:
        """Return the inputs of the frame sent last and its working counter.

        Frames with another number that wait before it are taken and forgotten.
        """
        self.advance()
        while True:
            try:
                head = self.master_end.recv(64)
            except BlockingIOError:
                return [], NO_FRAME
            number = int.from_bytes(head[INDEX + 1 :], "little")
            content = self._contents.pop(number)
            if number == self._sent:
                return content

    def _carry(self, frame: Frame, now: float) -> None:
        if now < self.deaf_s:
            return
        inputs, counter = [], 0
        if now < max(self.mute_s, self.slow_s):
            for slave in self.reachable:
                slave.drive.judge.lose_answer(now)
        for slave, outputs in zip(self.slaves, frame.outputs, strict=True):
            if slave in self.reachable:
                data, added = slave.exchange(outputs, now, frame.sent_s)
                inputs.append(data)
                counter += added
        if now < self.mute_s:
            return
        head = bytearray(INDEX + 1)
        head[COMMAND], head[INDEX] = LRW, frame.number % NUMBERS
        self._contents[frame.number] = inputs, counter
        whole = bytes(head) + frame.number.to_bytes(8, "little")
        if now < self.slow_s:
            self._late.append((now + self.delay_s, whole))
        else:
            self._our_end.send(whole)


def _socket_pair() -> tuple[socket.socket, socket.socket]:
    """Return both ends of what stands for the raw socket: the master's, and the cable's."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    for end in ends:
        end.setblocking(False)
    return ends


class Slave:
    """``pysoem.CdefSlave`` of one slave."""

    def __init__(self, master: Master, place: int, cable: Cable, device: EthercatSlave) -> None:
        self._master, self._place, self._cable, self._device = master, place, cable, device
        self.name = device.name
        self.man, self.id, self.rev, self._serial = device.identity
        self.output = self.input = b""
        self.state = 0
        self._callbacks: list[Callable[[Any], None]] = []

    def write_state(self) -> None:
        if self._cable.answers(self._device):
            self._device.request(self.state)

    def recover(self) -> int:
        if self._device in self._cable.reachable:
            self._device.addressed = True
        return int(self._cable.answers(self._device))

    def _fprd(self, address: int, size: int, timeout_us: int) -> bytes:
        self._require_answer()
        if address == 0x0130:
            status, code = self._device.al_status
            found = status.to_bytes(2, "little") + bytes(2) + code.to_bytes(2, "little")
            return found[:size]
        return bytes(self._device.registers[address : address + size])

    def _fpwr(self, address: int, data: bytes, timeout_us: int) -> None:
        self._require_answer()
        self._device.registers[address : address + len(data)] = data

    def set_watchdog(self, kind: str, milliseconds: float) -> None:
        self._require_answer()
        self._device.watchdog_s = milliseconds * 1e-3

    def eeprom_read(self, word: int) -> bytes:
        return (self._serial if word == 0x000E else 0).to_bytes(4, "little")

    def dc_sync(self, act: bool, period_ns: int, shift_ns: int) -> None:
        self._device.registers[0x0981] = 3 if act else 0

    def sdo_read(self, index: int, sub: int, size: int = 0, *, release_gil: bool = False) -> bytes:
        self._await_answer(self._master.sdo_read_timeout)
        return bytes(self._transfer(lambda: self._device.upload(index, sub)))

    def sdo_write(
        self, index: int, sub: int, data: bytes, ca: bool = False, *, release_gil: bool = False
    ) -> None:
        self._await_answer(self._master.sdo_write_timeout)
        self._transfer(lambda: self._device.download(index, sub, data))

    def mbx_receive(self) -> int:
        self._require_answer()
        found = self._device.emergencies()
        for data in found:
            message = SimpleNamespace(
                error_code=int.from_bytes(data[:2], "little"),
                error_reg=data[2],
                b1=data[3],
                w1=int.from_bytes(data[4:6], "little"),
                w2=int.from_bytes(data[6:8], "little"),
            )
            for callback in self._callbacks:
                callback(message)
        return int(bool(found))

    def add_emergency_callback(self, callback: Callable[[Any], None]) -> None:
        self._callbacks.append(callback)

    def _disable_complete_access(self) -> None:
        pass

    def _await_answer(self, timeout_us: int) -> None:
        delay_s, timeout_s = self._device.drive.knobs.sdo_delay_s, timeout_us * 1e-6
        self._cable.sleep(min(delay_s, timeout_s))
        if delay_s > timeout_s:
            raise WkcError

    def _transfer(self, action: Callable[[], Any]) -> Any:
        self._require_answer()
        try:
            return action()
        except Abort as abort:
            raise SdoError(self._place + 1, abort.code) from abort
        except TimeoutError as error:
            raise WkcError from error

    def _require_answer(self) -> None:
        self._cable.advance()
        if not self._cable.answers(self._device):
            raise WkcError


class Master:
    """``pysoem.Master`` on a cable."""

    manual_state_change = sdo_read_timeout = sdo_write_timeout = 0

    def __init__(self, cable: Cable) -> None:
        self._cable = cable
        self.slaves: list[Slave] = []
        self.state = 0

    def open(self, interface: str, redundant: str | None) -> None:
        pass

    def close(self) -> None:
        self.slaves = []

    def config_init(self, usetable: bool = False, *, release_gil: bool = False) -> int:
        """Enumerate: the slaves get their addresses and go to Init."""
        cable = self._cable
        cable.advance()
        if cable.now_s() < max(cable.deaf_s, cable.mute_s, cable.blocked_s):
            self.slaves = []
            return 0
        self.slaves = [Slave(self, n, cable, one) for n, one in enumerate(cable.reachable)]
        for device in cable.reachable:
            device.addressed = True
            device.request(Al.INIT | 0x10)
        return len(self.slaves)

    def write_state(self) -> None:
        for slave in self.slaves:
            slave.state = self.state
            slave.write_state()

    def config_map(self) -> int:
        size = 0
        for slave in self.slaves:
            out, inputs = slave._device.sizes()
            slave.output, slave.input = bytes(out), bytes(inputs)
            size += out + inputs
        return size

    def config_dc(self) -> bool:
        return bool(self.slaves)

    @property
    def dc_time(self) -> int:
        return round(self._cable.now_s() * 1e9)

    @property
    def expected_wkc(self) -> int:
        return sum(2 * bool(slave.output) + bool(slave.input) for slave in self.slaves)

    def send_processdata(self) -> None:
        outputs = [bytes(slave.output) for slave in self.slaves]
        outputs += [b""] * (len(self._cable.slaves) - len(outputs))
        self._cable.send(outputs)

    def receive_processdata(self, timeout: int, *, release_gil: bool = False) -> int:
        inputs, counter = self._cable.receive()
        for slave, data in zip(self.slaves, inputs, strict=False):
            if data:
                slave.input = data
        return counter


def library(cable: Cable) -> Any:
    """Return what stands for the module pysoem."""
    return SimpleNamespace(
        Master=lambda: Master(cable),
        SdoError=SdoError,
        WkcError=WkcError,
        MailboxError=MailboxError,
        PacketError=PacketError,
        ConfigMapError=ConfigMapError,
        settings=SimpleNamespace(timeouts=SimpleNamespace(ret=0)),
    )
