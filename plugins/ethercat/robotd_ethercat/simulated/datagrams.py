"""EtherCAT datagrams: commands and working counters on a row of slave controllers."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum

from robotd_ethercat.simulated.logical_access import LogicalAccess
from robotd_ethercat.simulated.registers import DC_SYSTEM_TIME
from robotd_ethercat.simulated.slave_controller import SlaveController

ETHERTYPE = 0x88A4
MAX_FRAME = 1518
_FIRST = 16  # Ethernet header and EtherCAT header
_HEADER = struct.Struct("<BBHHHH")  # command, index, address, offset, length and flags, interrupt
_COUNTER = struct.Struct("<H")
_ADDRESS = struct.Struct("<H")
_LENGTH, _MORE = 0x07FF, 0x8000
_DATAGRAMS = 1  # type of an EtherCAT frame


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
