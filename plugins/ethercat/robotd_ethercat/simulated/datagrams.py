"""EtherCAT datagrams: commands and working counters on a row of slave controllers."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import partial

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.registers import DC_SYSTEM_TIME
from robotd_ethercat.simulated.slave_controller import SlaveController
from robotd_ethercat.simulated.sync_manager import BitRange, SyncManager, copy_bits

ETHERTYPE = 0x88A4
MAX_FRAME = 1518
_FIRST = 16  # Ethernet header and EtherCAT header
_HEADER = struct.Struct("<BBHHHH")  # command, index, address, offset, length and flags, interrupt
_COUNTER = struct.Struct("<H")
_ADDRESS = struct.Struct("<H")
_LENGTH, _MORE = 0x07FF, 0x8000
_DATAGRAMS = 1  # type of an EtherCAT frame
_MAX_PLANS = 256  # a master uses a few layouts; random frames must not fill the memory


@dataclass
class LogicalPlan:
    """Effect of a logical datagram at one place of the frame buffer.

    Attributes:
        copies: target and source, in order; a source that is a function does the copy itself.
        working_counter: sum of the increments.
        written: slaves and SyncManagers of which the last byte is written.
    """

    copies: list[tuple[memoryview, memoryview | Callable[[], None]]] = field(default_factory=list)
    working_counter: int = 0
    written: list[tuple[SlaveController, SyncManager]] = field(default_factory=list)

    def run(self, now_ns: int) -> int:
        """Copy, and return the increment of the working counter."""
        for target, source in self.copies:
            if isinstance(source, memoryview):
                target[:] = source
            else:
                source()
        for controller, manager in self.written:
            controller.written(manager, now_ns)
        return self.working_counter


class LogicalAccess:
    """Plans of the logical datagrams of a line, cached until the configuration changes.

    Args:
        buffer: the frame buffer; plans hold slices of it.
    """

    def __init__(self, buffer: memoryview) -> None:
        self._buffer = buffer
        self._plans: dict[tuple[int, ...], LogicalPlan] = {}

    def clear(self) -> None:
        """Forget the plans: FMMUs, SyncManagers or cables changed."""
        self._plans.clear()

    def plan(
        self,
        slaves: Sequence[SlaveController],
        place: int,
        address: int,
        length: int,
        *,
        reads: bool,
        writes: bool,
    ) -> LogicalPlan:
        """Return the plan of a datagram with data at ``place`` of the buffer.

        ``slaves`` are neighbours on the line: a frame may pass a part of it.
        """
        passed = (id(slaves[0]), len(slaves)) if slaves else (0, 0)
        key = (*passed, place, address, length, reads, writes)
        found = self._plans.get(key)
        if found is None:
            if len(self._plans) >= _MAX_PLANS:
                self._plans.clear()
            data = self._buffer[place : place + length]
            found = self._plans[key] = LogicalPlan()
            for slave in slaves:
                _add_slave(found, slave, data, address, reads=reads, writes=writes)
        return found


def _add_slave(
    plan: LogicalPlan,
    slave: SlaveController,
    data: memoryview,
    address: int,
    *,
    reads: bool,
    writes: bool,
) -> None:
    """Add the copies of one slave: outputs first, as inputs may replace them."""
    memory = memoryview(slave.memory)
    fmmus = [(fmmu, fmmu.overlap(address, len(data))) for fmmu in slave.fmmus()]
    read = written = False
    for fmmu, part in fmmus:
        if part is not None and writes and fmmu.writes and _allowed(plan, slave, part, write=True):
            written = True
            plan.copies.append(_copy(memory, part.in_memory, data, part.in_datagram, part))
    for fmmu, part in fmmus:
        if part is not None and reads and fmmu.reads and _allowed(plan, slave, part, write=False):
            read = True
            plan.copies.append(_copy(data, part.in_datagram, memory, part.in_memory, part))
    plan.working_counter += int(read) + int(written) * (2 if reads else 1)


def _allowed(plan: LogicalPlan, slave: SlaveController, part: BitRange, *, write: bool) -> bool:
    """Check SyncManagers and memory; note a SyncManager whose last byte is written."""
    first, end = part.in_memory // 8, (part.in_memory + part.count + 7) // 8
    if end > reg.MEMORY_SIZE:
        return False
    if first < reg.PROCESS_RAM:  # registers: read only, such as the status of a mailbox
        return not write
    for manager in slave.sync_managers:
        if manager.length and manager.start <= first < manager.end:
            if not manager.active or manager.mailbox or manager.to_slave is not write:
                return False
            if write and end >= manager.end:
                plan.written.append((slave, manager))
    return True


def _copy(
    target: memoryview, target_bit: int, source: memoryview, source_bit: int, part: BitRange
) -> tuple[memoryview, memoryview | Callable[[], None]]:
    if part.in_bytes:
        size = part.count // 8
        into = target[target_bit // 8 : target_bit // 8 + size]
        return into, source[source_bit // 8 : source_bit // 8 + size]
    return target, partial(copy_bits, target, target_bit, source, source_bit, part.count)


class Command(IntEnum):
    """Commands of datagrams (ETG.1000.4)."""

    NOP = 0
    APRD = 1
    APWR = 2
    APRW = 3
    FPRD = 4
    FPWR = 5
    FPRW = 6
    BRD = 7
    BWR = 8
    BRW = 9
    LRD = 10
    LWR = 11
    LRW = 12
    ARMW = 13
    FRMW = 14


_READS = {int(c) for c in Command if c.name.endswith(("RD", "RW"))}
_WRITES = {int(c) for c in Command if c.name.endswith(("WR", "RW"))}
_LOGICAL = {int(c) for c in (Command.LRD, Command.LWR, Command.LRW)}
_POSITION = {int(c) for c in (Command.APRD, Command.APWR, Command.APRW, Command.ARMW)}
_BROADCAST = {int(c) for c in (Command.BRD, Command.BWR, Command.BRW)}
_MULTIPLE = {int(c) for c in (Command.ARMW, Command.FRMW)}
_TIME_SIZES = (4, 8)  # bytes of a distributed system time


class DatagramProcessor:
    """Processes the datagrams of a frame in its buffer, slave by slave.

    Attributes:
        buffer: the frame, with Ethernet header.
        logical: plans of logical datagrams; clear them when the configuration changes.
    """

    def __init__(self) -> None:
        self._bytes = bytearray(MAX_FRAME)
        self.buffer = memoryview(self._bytes)
        self.logical = LogicalAccess(self.buffer)

    def process(self, slaves: Sequence[SlaveController], length: int, now_ns: int) -> None:
        """Process all datagrams of a frame of ``length`` bytes; malformed ones are left alone."""
        position, more = _FIRST, length >= _FIRST and self._is_ethercat()
        while more and position + _HEADER.size + _COUNTER.size <= length:
            command, _, address, offset, flags, _ = _HEADER.unpack_from(self.buffer, position)
            size = flags & _LENGTH
            data = position + _HEADER.size
            counter = data + size
            if counter + _COUNTER.size > length:
                return
            increment = 0
            if command in _LOGICAL:
                increment = self.logical.plan(
                    slaves,
                    data,
                    address | offset << 16,
                    size,
                    reads=command in _READS,
                    writes=command in _WRITES,
                ).run(now_ns)
            elif Command.NOP < command <= Command.FRMW:
                increment = self._physical(slaves, command, position, address, offset, size, now_ns)
            if increment:
                before = _COUNTER.unpack_from(self.buffer, counter)[0]
                _COUNTER.pack_into(self.buffer, counter, before + increment & 0xFFFF)
            position, more = counter + _COUNTER.size, bool(flags & _MORE)

    def _is_ethercat(self) -> bool:
        return (
            self._bytes[12] == ETHERTYPE >> 8
            and self._bytes[13] == ETHERTYPE & 0xFF
            and (self._bytes[15] >> 4 == _DATAGRAMS)
        )

    def _physical(
        self,
        slaves: Sequence[SlaveController],
        command: int,
        position: int,
        address: int,
        offset: int,
        size: int,
        now_ns: int,
    ) -> int:
        """Process one datagram with position, station or broadcast addressing."""
        start = position + _HEADER.size
        data = self.buffer[start : start + size]
        total = 0
        auto, broadcast = command in _POSITION, command in _BROADCAST
        multiple = command in _MULTIPLE
        for slave in slaves:
            mine = broadcast or (address == 0 if auto else address in slave.station)
            if auto or broadcast:
                address = address + 1 & 0xFFFF
            if multiple:
                total += _read_multiple_write(slave, data, offset, now_ns, reads=mine)
            elif mine:
                total += _access(slave, command, data, offset, now_ns)
        if auto or broadcast:
            _ADDRESS.pack_into(self.buffer, position + 2, address)
        return total


def _read_multiple_write(
    slave: SlaveController, data: memoryview, offset: int, now_ns: int, *, reads: bool
) -> int:
    """Read from the addressed slave; write what it read to the slaves behind."""
    if not reads:
        if offset == DC_SYSTEM_TIME and len(data) in _TIME_SIZES:  # in every cycle
            slave.clock.received = bytes(data), now_ns + slave.arrival_ns
            return 1
        return int(slave.write(offset, bytes(data), now_ns))
    found = slave.read(offset, len(data), now_ns)
    if found is not None:
        data[:] = found
    return int(found is not None)


def _access(
    slave: SlaveController, command: int, data: memoryview, offset: int, now_ns: int
) -> int:
    """Read and write one slave; return the increment of the working counter."""
    reads, writes = command in _READS, command in _WRITES
    incoming = bytes(data)
    increment = 0
    if reads:
        found = slave.read(offset, len(data), now_ns)
        if found is not None:
            increment = 1
            if command in _BROADCAST:  # values of all slaves, combined by OR
                found = bytes(a | b for a, b in zip(incoming, found, strict=True))
            data[:] = found
    if writes and slave.write(offset, incoming, now_ns):
        increment += 2 if reads else 1
    return increment
