"""FMMU: fieldbus memory management unit, maps logical addresses to memory, bit by bit."""

from __future__ import annotations

import struct
from dataclasses import dataclass

_LAYOUT = struct.Struct("<IHBBHBBB3x")
READ, WRITE = 1, 2


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
