"""EtherCAT slave with one CiA 402 axis, written from ETG.1000.4, ETG.1000.6 and ETG.6010.

It shares no code with robotd, and the axis is that of the independent CANopen drive: CoE takes over
object dictionary and drive profile. Pure logic: process data and the time go in.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import can
from tests.plugins.independent.canopen_objects import UNSUPPORTED_ACCESS, Abort, Entry
from tests.plugins.independent.knobs import Knobs
from tests.witness.judge import Judge
from tests.witness.tapped_drive import TappedDrive

RX_PDO, TX_PDO, RX_ASSIGN, TX_ASSIGN = 0x1600, 0x1A00, 0x1C12, 0x1C13
OUTPUTS = (0x6040, 0x6060, 0x607A, 0x60FF, 0x6071)
INPUTS = (0x6041, 0x6061, 0x6064, 0x606C, 0x6077, 0x603F)
MAPPED = 8
INVALID_CHANGE, UNKNOWN_STATE, WATCHDOG = 0x0011, 0x0012, 0x001B  # AL status codes (ETG.1020)


class Al(IntEnum):
    """States of the EtherCAT state machine."""

    INIT = 1
    PRE_OP = 2
    SAFE_OP = 4
    OP = 8


UP = {Al.INIT: Al.PRE_OP, Al.PRE_OP: Al.SAFE_OP, Al.SAFE_OP: Al.OP}


class CoeDrive(TappedDrive):
    """The drive without the services of CAN: NMT, SYNC, PDO parameters and heartbeats."""

    def __init__(self, knobs: Knobs, judge: Judge, counts_per_rad: float) -> None:
        self.emergency_data: list[bytes] = []
        self.configurable = True  # PreOp: mapping and assignment may change
        super().__init__(1, self._collect, knobs, judge, counts_per_rad)

    def _add_communication_objects(self) -> None:
        super()._add_communication_objects()
        for index in [i for i in self.names if 0x1400 <= i < 0x1C00]:
            self.remove(index)
            self.names.pop(index), self.hooks.pop(index, None)

    def _map_pdos(self) -> None:
        """Add mapping and assignment with their defaults."""
        for pdo, assign, what, objects in (
            (RX_PDO, RX_ASSIGN, "RxPDO", OUTPUTS),
            (TX_PDO, TX_ASSIGN, "TxPDO", INPUTS),
        ):
            words = [self._word(index) for index in objects]
            words += [0] * (MAPPED - len(words))
            entries = [Entry(f"Mapped object {n + 1}", "I", word) for n, word in enumerate(words)]
            self.add(pdo, f"{what} mapping", *entries)
            self.objects[pdo, 0] = Entry("Number of objects", "B", len(objects))
            self.add(assign, f"{what} assignment", Entry("PDO 1", "H", pdo), subs=(1,))
            self.objects[assign, 0] = Entry("Number of PDOs", "B", 1)
            self.hooks[pdo] = self.hooks[assign] = self._check_configurable

    def _word(self, index: int) -> int:
        return index << 16 | 8 * self.objects[index, 0].size

    def _check_configurable(self, sub: int, value: int) -> None:
        if not self.configurable:
            raise Abort(UNSUPPORTED_ACCESS)

    def _collect(self, message: can.Message) -> None:
        if message.arbitration_id == 0x80 + self.node_id:
            self.emergency_data.append(bytes(message.data))

    def write_cyclic(self, values: list[tuple[int, int, bytes]], now: float, sent_s: float) -> None:
        """Execute process data."""
        self._advance(now)
        self._frame_s = self._data_s = sent_s
        self.apply(values)

    def leave_op(self) -> None:
        """React to the end of cyclic operation, as 0x6007 says."""
        self._abort_connection()

    def objects_of(self, assign: int) -> list[tuple[int, int, int]]:
        """Return index, sub-index and bytes of the objects in an assignment."""
        found = []
        for number in range(1, self[assign] + 1):
            pdo = self[assign, number]
            words = [self[pdo, sub] for sub in range(1, self[pdo] + 1)]
            found += [(word >> 16, word >> 8 & 0xFF, (word & 0xFF) // 8) for word in words]
        return found


class EthercatSlave:
    """One slave on the cable.

    Attributes:
        addressed: it has the station address that the master has set.
        watchdog_s: of process data, after ETG.1000.4 (0x0400, 0x0420); 0: none.
        silent_s: until then it processes no process data, but passes them on.
        hung_s: until then its mailbox does not answer.
        boot_s: until then its application does not act on requests of a state.
        aborts: abort codes by object, of SDO transfers to come.
    """

    name = "Independent EtherCAT drive"
    identity = (0x29C, 402, 0x10001, 1)

    def __init__(self, knobs: Knobs, judge: Judge, counts_per_rad: float) -> None:
        self.drive = CoeDrive(knobs, judge, counts_per_rad)
        self.state, self.code = Al.INIT, 0
        self.registers = bytearray(0x1000)
        self.registers[0x0008] = 1 << 2  # it has a distributed clock
        self.watchdog_s = 0.1
        self.silent_s = self.hung_s = self.boot_s = 0.0
        self._requested: int | None = None  # while it boots
        self.aborts: dict[int, int] = {}
        self.addressed = False
        self._outputs_s = 0.0  # of the last process data
        self._now = 0.0

    # Time

    def tick(self, now: float) -> None:
        self._now = now
        if self._requested is not None and now >= self.boot_s:
            self.request(self._requested)
        self.drive.tick(now)
        late = self.watchdog_s and now - self._outputs_s > self.watchdog_s
        if self.state is Al.OP and late:
            self.state, self.code = Al.SAFE_OP, WATCHDOG
            self.drive.leave_op()

    def power_cycle(self) -> None:
        """Restart: state, address and configuration are lost."""
        self.state, self.code, self.addressed = Al.INIT, 0, False
        self.drive.configurable = True
        self.drive.restart()

    # State machine

    def request(self, control: int) -> None:
        """Take the AL control register: a state, with bit 4 to acknowledge an error."""
        state = control & 0x0F
        self._requested = control if self._now < self.boot_s else None
        if self._requested is not None or (self.code and not control & 0x10):
            return
        self.code = 0
        if state not in set(Al):
            self.code = UNKNOWN_STATE
        elif state > self.state and UP[self.state] != state:
            self.code = INVALID_CHANGE
        else:
            self._enter(Al(state))

    def _enter(self, state: Al) -> None:
        if self.state is Al.OP and state is not Al.OP:
            self.drive.leave_op()
        self._outputs_s = self._now
        self.state = state
        self.drive.configurable = state is Al.PRE_OP

    @property
    def al_status(self) -> tuple[int, int]:
        return self.state | (0x10 if self.code else 0), self.code

    # Process data

    def sizes(self) -> tuple[int, int]:
        out, inputs = (self.drive.objects_of(assign) for assign in (RX_ASSIGN, TX_ASSIGN))
        return sum(size for _, _, size in out), sum(size for _, _, size in inputs)

    def exchange(self, outputs: bytes, now: float, sent_s: float) -> tuple[bytes, int]:
        """Process a frame; return the inputs and what it adds to the working counter."""
        self.tick(now)
        if now < self.silent_s or self.state not in {Al.SAFE_OP, Al.OP}:
            return b"", 0
        inputs = b"".join(
            self.drive.objects[index, sub].encode() if index else bytes(size)
            for index, sub, size in self.drive.objects_of(TX_ASSIGN)
        )
        if self.state is Al.SAFE_OP:
            return inputs, 1
        self._outputs_s = now
        self.drive.write_cyclic(self._values(outputs), now, sent_s)
        return inputs, 3

    def _values(self, outputs: bytes) -> list[tuple[int, int, bytes]]:
        values, at = [], 0
        for index, sub, size in self.drive.objects_of(RX_ASSIGN):
            if index:
                values.append((index, sub, outputs[at : at + size]))
            at += size
        return values

    # Mailbox

    def upload(self, index: int, sub: int) -> bytes:
        self._require_mailbox(index)
        return self.drive.read(index, sub)

    def download(self, index: int, sub: int, data: bytes) -> None:
        self._require_mailbox(index)
        self.drive.write(index, sub, data)

    def emergencies(self) -> Sequence[bytes]:
        """Take the emergencies that wait in the mailbox."""
        found = list(self.drive.emergency_data)
        self.drive.emergency_data.clear()
        return found

    def _require_mailbox(self, index: int) -> None:
        """Raise TimeoutError: no answer comes; Abort: the object is refused."""
        if self.state is Al.INIT or self._now < self.hung_s:
            raise TimeoutError
        if index in self.aborts:
            raise Abort(self.aborts.pop(index))
