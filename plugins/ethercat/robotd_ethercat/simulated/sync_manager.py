"""SyncManager: consistent memory between master and slave, buffered or as a mailbox."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from robotd_ethercat.simulated import registers as reg

_MAILBOX, _TO_SLAVE, _WATCHDOG = 0x02, 0x04, 0x40
_FULL = 0x08
_ACTIVE, _REPEAT = 0x01, 0x02
_LAYOUT = struct.Struct("<IHBBHBBB3x")
READ, WRITE = 1, 2


class SyncManager:
    """One SyncManager; its registers are in the memory of the slave controller.

    Buffered mode is exchanged frame by frame: a frame is processed as a whole, so that the three
    buffers of a real controller are not needed for consistency.

    Attributes:
        start, length: physical area, bytes.
        mailbox: mailbox mode, with a full/empty handshake; else buffered.
        to_slave: written by the master.
        watchdog: writes restart the process data watchdog.
        activated: activated by the master.
        active: activated, and not deactivated by the slave.
    """

    def __init__(self, memory: bytearray, number: int) -> None:
        self._memory = memory
        self._base = reg.SYNC_MANAGER + reg.SYNC_MANAGER_SIZE * number
        self.configure()

    def configure(self) -> bool:
        """Read the registers again; return True if the master toggled the repeat request."""
        memory, base = self._memory, self._base
        self.start = int.from_bytes(memory[base : base + 2], "little")
        self.length = int.from_bytes(memory[base + 2 : base + 4], "little")
        control = memory[base + 4]
        self.mailbox = control & 3 == _MAILBOX
        self.to_slave = bool(control & _TO_SLAVE)
        self.watchdog = bool(control & _WATCHDOG)
        self.activated = bool(memory[base + 6] & _ACTIVE) and self.length > 0
        self.active = self.activated and not memory[base + 7] & _ACTIVE
        if not self.active:
            self.full = False
        return bool((memory[base + 6] ^ memory[base + 7]) & _REPEAT)

    @property
    def end(self) -> int:
        """First address behind the area."""
        return self.start + self.length

    @property
    def full(self) -> bool:
        """Mailbox mode: a message waits for its reader."""
        return bool(self._memory[self._base + 5] & _FULL)

    @full.setter
    def full(self, full: bool) -> None:
        status = self._memory[self._base + 5]
        self._memory[self._base + 5] = status | _FULL if full else status & ~_FULL

    def deactivate(self, inactive: bool) -> None:
        """Deactivate the SyncManager from the side of the slave, or allow it again."""
        control = self._memory[self._base + 7]
        self._memory[self._base + 7] = control & ~_ACTIVE | int(inactive)
        self.configure()

    def acknowledge_repeat(self) -> None:
        """Answer a repeat request: the last message is in the mailbox again."""
        activate, control = self._memory[self._base + 6], self._memory[self._base + 7]
        self._memory[self._base + 7] = control & ~_REPEAT | activate & _REPEAT

    def overlaps(self, address: int, length: int) -> bool:
        """Return True if the area shares a byte with ``address`` …."""
        return self.active and address < self.end and self.start < address + length

    def allows_read(self, address: int, length: int) -> bool:
        """Return True if the master may read: buffered, or a full mailbox from its start."""
        if not self.mailbox:
            return True
        return not self.to_slave and self.full and address == self.start

    def allows_write(self, address: int, length: int) -> bool:
        """Return True if the master may write: outputs, or an empty mailbox from its start."""
        if not self.to_slave:
            return False
        return not self.mailbox or (not self.full and address == self.start)


@dataclass(frozen=True)
class BitRange:
    """Part of a datagram that an FMMU maps: offsets in bits.

    Attributes:
        in_datagram: first bit in the data of the datagram.
        in_memory: first bit in the memory of the slave controller.
        count: number of bits.
    """

    in_datagram: int
    in_memory: int
    count: int

    @property
    def in_bytes(self) -> bool:
        """True if all offsets are whole bytes."""
        return not (self.in_datagram | self.in_memory | self.count) & 7


@dataclass(frozen=True)
class Fmmu:
    """One FMMU as its registers describe it.

    Attributes:
        first_bit, bits: logical area, in bits.
        memory_bit: first bit of the physical area.
        reads, writes: directions, as seen by the master.
    """

    first_bit: int
    bits: int
    memory_bit: int
    reads: bool
    writes: bool

    @classmethod
    def of(cls, registers: bytes | bytearray | memoryview) -> Fmmu | None:
        """Decode 16 bytes of registers; None for an inactive FMMU."""
        start, length, start_bit, stop_bit, memory, memory_bit, kind, active = _LAYOUT.unpack(
            registers
        )
        first = 8 * start + (start_bit & 7)
        end = 8 * (start + length - 1) + (stop_bit & 7) + 1
        if not active & 1 or length == 0 or end <= first:
            return None
        memory_first = 8 * memory + (memory_bit & 7)
        return cls(first, end - first, memory_first, bool(kind & READ), bool(kind & WRITE))

    def overlap(self, address: int, length: int) -> BitRange | None:
        """Return the mapped part of the logical area ``address`` …; None for no part."""
        low = max(self.first_bit, 8 * address)
        high = min(self.first_bit + self.bits, 8 * (address + length))
        if high <= low:
            return None
        return BitRange(low - 8 * address, self.memory_bit + low - self.first_bit, high - low)


def copy_bits(
    target: memoryview, target_bit: int, source: memoryview, source_bit: int, count: int
) -> None:
    """Copy ``count`` bits from ``source_bit`` of ``source`` to ``target_bit`` of ``target``."""
    source_end, target_end = (source_bit + count + 7) // 8, (target_bit + count + 7) // 8
    mask = (1 << count) - 1
    value = int.from_bytes(source[source_bit // 8 : source_end], "little") >> (source_bit & 7)
    shift, area = target_bit & 7, target[target_bit // 8 : target_end]
    before = int.from_bytes(area, "little")
    after = before & ~(mask << shift) | (value & mask) << shift
    area[:] = after.to_bytes(len(area), "little")
