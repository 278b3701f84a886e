"""EtherCAT bus in this process, in the place of ``Soem``: slaves with mailbox, states and drives.

Time is that of the clock that it is given, so that a whole robot runs on a ``SteppedClock``.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from robotd.api import Clock, ConnectError, DeviceTimeout
from robotd_cia402.drive_access import SdoAbort
from robotd_cia402.object_numbers import on_axis
from robotd_cia402.simulated import (
    DRIVE_OBJECTS,
    Drive,
    DriveFaults,
    DriveModel,
    Motors,
    Scale,
    drive_defaults,
)
from robotd_ethercat.al_status import AlState
from robotd_ethercat.soem import NO_ANSWER, NO_FRAME, SlaveState

COUNTS_PER_RAD = 100_000.0
NO_OBJECT = 0x06020000
OUTPUTS = ((0x6040, "H"), (0x6060, "b"), (0x607A, "i"), (0x60FF, "i"), (0x6072, "H"))
INPUTS = (
    (0x6041, "H"), (0x6061, "b"), (0x6064, "i"), (0x606C, "i"), (0x6077, "h"), (0x603F, "H"),
    (0x60FD, "I"), (0x6062, "i"),
)  # fmt: skip
_KINDS = {
    (on_axis(entry.index, axis), entry.sub): entry.kind
    for entry in DRIVE_OBJECTS
    for axis in (0, 1)
}


def _numbers(entries: Sequence[tuple[int, str]]) -> list[int]:
    return [index << 16 | 8 * struct.calcsize(code) for index, code in entries]


@dataclass
class FakeSlave:
    """A slave; ``drive`` is None for an I/O module of 2 bytes each way.

    Attributes:
        rejects: AL state → AL status code with which the slave rejects it.
        registers: memory of the slave controller.
    """

    name: str
    identity: tuple[int, int, int, int] = (0x1234, 0x5678, 1, 77)
    alias: int = 0
    drive: Drive | None = None
    values: dict[tuple[int, int], int] = field(default_factory=dict)
    outputs: Sequence[tuple[int, str]] = OUTPUTS
    inputs: Sequence[tuple[int, str]] = INPUTS
    state: AlState = AlState.INIT
    code: int = 0
    present: bool = True
    silent_mailbox: bool = False
    rejects: dict[AlState, int] = field(default_factory=dict)
    registers: bytearray = field(default_factory=lambda: bytearray(0x1000))
    written: list[tuple[int, int, bytes]] = field(default_factory=list)
    emergencies: list[bytes] = field(default_factory=list)
    handler: Callable[[bytes], None] = bytes.hex  # type: ignore[assignment]
    input: bytes = b"\0\0"
    output: bytes = b"\0\0"

    @property
    def output_struct(self) -> struct.Struct:
        return struct.Struct("<" + "".join(code for _, code in self.outputs))

    @property
    def input_struct(self) -> struct.Struct:
        return struct.Struct("<" + "".join(code for _, code in self.inputs))

    def power_cycle(self) -> None:
        """Lose configuration and process data."""
        self.state, self.present = AlState.INIT, True
        if self.drive is not None:
            self.drive.power_on()
            self.output = bytes(self.output_struct.size)

    def exchange(self) -> int:
        """Take outputs and refresh inputs; returns what it adds to the working counter."""
        if not self.present or self.state not in (AlState.SAFE_OP, AlState.OP):
            return 0
        if self.drive is not None:
            if self.state is AlState.OP:
                values = self.output_struct.unpack(self.output)
                for (index, _), value in zip(self.outputs, values, strict=True):
                    self.values[index, 0] = value
            self.drive.sync(0.002)
            self.input = self.input_struct.pack(*(self.values[i, 0] for i, _ in self.inputs))
        return 3 if self.state is AlState.OP else 1


class FakeBus:
    """Implements the methods of ``Soem`` over ``FakeSlave``; drives first, then modules.

    Attributes:
        all: the slaves on the cable; ``slaves``: those found by the last scan.
        lost_frames: frames that are lost from now on.
        bus_drift: of the bus time against the clock, relative.
        slow_frames: frames that come back too late for their own period, from now on.
        is_blocked: what is sent waits in the interface; sent: frames so far.
        late_frames: frames that wait behind the next one.
        answers_late: AL states are read as if no slave had answered.
        misread: slave → wrong AL state that is read next, once.
        interfaces: opened so far.
        map_errors: raised by the next mappings.
    """

    def __init__(self, clock: Clock, drives: int, modules: int = 1) -> None:
        self._clock = clock
        self.motors = Motors([0.0] * drives, clock.now_ns())
        self.all = [self._drive(number) for number in range(drives)]
        self.all += [FakeSlave(f"io{number}") for number in range(modules)]
        self.slaves: Sequence[FakeSlave] = ()
        self.lost_frames = self.late_frames = self.slow_frames = 0
        self.answers_late = self.is_blocked = False
        self.sent = 0
        self.bus_drift = 0.0
        self.misread: dict[int, SlaveState] = {}
        self.frame_timeout_s = 0.0
        self.interfaces: list[str] = []
        self.sync0: dict[int, tuple[int, int, bool]] = {}
        self.watchdogs: dict[int, float] = {}
        self.map_errors: list[Exception] = []
        self.plain_sdo: set[int] = set()
        self._counter: int | None = None

    def _drive(self, number: int) -> FakeSlave:
        values = drive_defaults()
        values |= {(0x1C12, 0): 1, (0x1C12, 1): 0x1600, (0x1C13, 0): 1, (0x1C13, 1): 0x1A00}
        for pdo, entries in ((0x1600, OUTPUTS), (0x1A00, INPUTS)):
            numbers = _numbers(entries)
            values |= {(pdo, sub): entry for sub, entry in enumerate(numbers, start=1)}
            values[pdo, 0] = len(numbers)
        values[0x1000, 0] = 0x00020192
        slave = FakeSlave(f"drive{number}", values=values)
        scale = Scale(COUNTS_PER_RAD, COUNTS_PER_RAD, COUNTS_PER_RAD, 1)

        def emergency(code: int, register: int) -> None:
            slave.emergencies.append(struct.pack("<HB5s", code, register, b""))

        slave.drive = Drive(
            DriveModel(number, scale), values, self.motors, DriveFaults(), emergency
        )
        slave.drive.power_on()
        slave.registers[0x0008] = 1 << 2
        slave.output = bytes(slave.output_struct.size)
        slave.input = bytes(slave.input_struct.size)
        return slave

    def open(self, interface: str, redundant_interface: str | None) -> None:
        if interface == "missing":
            raise ConnectError("the network interface cannot be opened", {interface: "missing"})
        self.interfaces.append(interface)

    def set_frame_timeout(self, seconds: float) -> None:
        self.frame_timeout_s = seconds

    def close(self) -> None:
        self.slaves = ()

    def find_slaves(self) -> int:
        self.slaves = self._reachable()
        for slave in self.slaves:
            slave.state, slave.code = AlState.INIT, 0
        return len(self.slaves)

    def states(self) -> list[SlaveState]:
        return [self.state(number) for number in range(len(self.slaves))]

    def state(self, slave: int) -> SlaveState:
        one = self.slaves[slave]
        if slave in self.misread:
            return self.misread.pop(slave)
        if self.answers_late or not self._answers(one):
            return NO_ANSWER
        return SlaveState(one.state, one.code != 0, one.code)

    def request(
        self, state: AlState, slave: int | None = None, *, acknowledge: bool = False
    ) -> None:
        for one in self.slaves if slave is None else [self.slaves[slave]]:
            if not self._answers(one):
                continue
            if state in one.rejects:
                one.code = one.rejects[state]
            elif not one.code or acknowledge:
                one.state, one.code = state, 0

    def find_again(self, slave: int) -> bool:
        return self._answers(self.slaves[slave])

    def map(self) -> None:
        if self.map_errors:
            raise self.map_errors.pop(0)
        for slave in self.slaves:
            if slave.drive is not None:
                slave.outputs = self._mapped(slave, 0x1C12)
                slave.inputs = self._mapped(slave, 0x1C13)
                slave.output = bytes(slave.output_struct.size)
                slave.input = bytes(slave.input_struct.size)

    def find_clocks(self) -> bool:
        return any(slave.drive is not None for slave in self.slaves)

    def set_sync0(self, slave: int, period_ns: int, shift_ns: int, *, active: bool) -> None:
        self.sync0[slave] = (period_ns, shift_ns, active)

    def set_watchdog(self, slave: int, milliseconds: float) -> None:
        self.watchdogs[slave] = milliseconds

    @property
    def expected_counter(self) -> int:
        return 3 * len(self.slaves)

    @property
    def bus_time_ns(self) -> int:
        return round(self._clock.now_ns() * (1 + self.bus_drift))

    def note_all_sent(self) -> None:
        pass

    def send(self) -> None:
        self.sent += 1
        if self.is_blocked:
            self._counter = NO_FRAME
            return
        if self.lost_frames > 0:
            self.lost_frames -= 1
            self._counter = NO_FRAME
            return
        self.motors.synchronise(self._clock.now_ns(), 0.002)
        for slave in self.all:
            if slave.drive is not None:
                slave.drive.sample(0.002)
        self._counter = sum(slave.exchange() for slave in self._reachable()) or NO_FRAME

    def await_process_data(self, timeout_s: float) -> bool:
        slow, self.slow_frames = self.slow_frames > 0, max(0, self.slow_frames - 1)
        return self._counter != NO_FRAME and not slow

    def receive(self, timeout_us: int, *, release_gil: bool) -> int:
        counter, self._counter = self._counter, None
        return NO_FRAME if counter is None else counter

    def drop_late_frames(self) -> bool:
        found, self.late_frames = self.late_frames, 0
        return found > 0

    def upload(self, slave: int, index: int, sub: int) -> bytes:
        one = self._mailbox(slave)
        if (index, sub) not in one.values:
            raise SdoAbort(f"abort 0x{NO_OBJECT:08X}, the object does not exist", NO_OBJECT)
        size = self._size(index, sub)
        return (one.values[index, sub] % (1 << 8 * size)).to_bytes(size, "little")

    def download(
        self, slave: int, index: int, sub: int, data: bytes, *, retry: bool = True
    ) -> None:
        one = self._mailbox(slave)
        one.written.append((index, sub, data))
        signed = _KINDS.get((index, sub), (8, False))[1]
        one.values[index, sub] = int.from_bytes(data, "little", signed=signed)

    def poll_mailbox(self, slave: int) -> None:
        one = self._mailbox(slave)
        while one.emergencies:
            one.handler(one.emergencies.pop(0))

    def on_emergency(self, slave: int, handler: Callable[[bytes], None]) -> None:
        self.slaves[slave].handler = handler

    def read_register(self, slave: int, address: int, size: int) -> bytes:
        one = self.slaves[slave]
        if not self._answers(one):
            raise DeviceTimeout(f"register 0x{address:04X}: no answer")
        if address == 0x0012:
            return one.alias.to_bytes(2, "little")
        return bytes(one.registers[address : address + size])

    def write_register(self, slave: int, address: int, data: bytes) -> None:
        if not self._answers(self.slaves[slave]):
            raise DeviceTimeout(f"register 0x{address:04X}: no answer")
        registers = self.slaves[slave].registers
        registers[address : address + len(data)] = data
        if address in range(0x0300, 0x0314):
            registers[0x0300:0x0314] = bytes(0x14)

    def read_sii(self, slave: int, word: int) -> int:
        return 0xFFFF

    def identity(self, slave: int) -> tuple[int, int, int, int]:
        return self.slaves[slave].identity

    def _reachable(self) -> list[FakeSlave]:
        """Slaves up to the first one that has no power: it passes no frame on."""
        found = []
        for slave in self.all:
            if not slave.present:
                break
            found.append(slave)
        return found

    def _answers(self, slave: FakeSlave) -> bool:
        return slave in self._reachable()

    def _mailbox(self, slave: int) -> FakeSlave:
        one = self.slaves[slave]
        if one.silent_mailbox or not self._answers(one):
            raise DeviceTimeout("no answer of the mailbox within 0.7 s")
        return one

    @staticmethod
    def _size(index: int, sub: int) -> int:
        if index in range(0x1600, 0x1C00):
            return 4 if sub else 1
        if index in (0x1C12, 0x1C13):
            return 2 if sub else 1
        return _KINDS[index, sub][0] // 8 if (index, sub) in _KINDS else 4

    @staticmethod
    def _mapped(slave: FakeSlave, assignment: int) -> list[tuple[int, str]]:
        codes = {(8, True): "b", (16, True): "h", (32, True): "i",
                 (8, False): "B", (16, False): "H", (32, False): "I"}  # fmt: skip
        values, found = slave.values, []
        for number in range(1, values[assignment, 0] + 1):
            pdo = values[assignment, number]
            for sub in range(1, values[pdo, 0] + 1):
                entry = values[pdo, sub] % (1 << 32)
                index = entry >> 16
                code = codes[_KINDS[index, 0]]
                found.append((index, code))
        return found
