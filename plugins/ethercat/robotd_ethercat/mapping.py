"""PDO assignment (0x1C12, 0x1C13) and PDO mapping of a slave: read, write, and check."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from robotd.api import OperationError
from robotd_cia402.options import parse_object
from robotd_ethercat.object_types import object_format
from robotd_ethercat.options import PdoOptions

MAX_ENTRIES = 254  # of one assignment or PDO


class Assignment(IntEnum):
    """Object that lists the PDOs of a sync manager."""

    OUTPUTS = 0x1C12
    INPUTS = 0x1C13


class ObjectAccess(Protocol):
    """SDO transfers with one slave. Worker threads."""

    def upload(self, index: int, sub: int = 0) -> bytes:
        """Return the raw value."""

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write the raw value."""


@dataclass(frozen=True)
class Entry:
    """One object in a PDO; index 0 is a gap of ``bits``."""

    index: int
    sub: int
    bits: int

    @classmethod
    def decode(cls, number: int) -> Entry:
        """Entry of a mapping object, 32 bits."""
        return cls(number >> 16, number >> 8 & 0xFF, number & 0xFF)

    @property
    def number(self) -> int:
        """As in a mapping object."""
        return self.index << 16 | self.sub << 8 | self.bits

    def __str__(self) -> str:
        return (
            f"0x{self.index:04X}:{self.sub:02X} {self.bits} bit"
            if self.index
            else (f"gap of {self.bits} bit")
        )


@dataclass(frozen=True)
class Pdo:
    """One assigned PDO and its contents."""

    index: int
    entries: tuple[Entry, ...]

    @property
    def bits(self) -> int:
        return sum(entry.bits for entry in self.entries)


def read_mapping(objects: ObjectAccess, assignment: Assignment) -> list[Pdo]:
    """Return the PDOs in ``assignment`` with their contents. Raises OperationError."""
    return [
        Pdo(index, tuple(Entry.decode(number) for number in _read_list(objects, index)))
        for index in _read_list(objects, assignment)
    ]


def write_mapping(
    objects: ObjectAccess, assignment: Assignment, pdos: Sequence[PdoOptions]
) -> None:
    """Write contents and assignment, in state PreOp. Raises OperationError.

    A PDO without objects keeps the contents that the slave has.
    """
    objects.download(assignment, 0, bytes(1))
    for pdo in pdos:
        if pdo.objects:
            entries = [_entry(objects, name).number for name in pdo.objects]
            objects.download(pdo.index, 0, bytes(1))
            _write_list(objects, pdo.index, entries, size=4)
    _write_list(objects, assignment, [pdo.index for pdo in pdos], size=2)


def size_bytes(pdos: Iterable[Pdo]) -> int:
    """Return the bytes that the PDOs need in the process data."""
    return (sum(pdo.bits for pdo in pdos) + 7) // 8


def _entry(objects: ObjectAccess, name: str) -> Entry:
    index, sub = parse_object(name)
    known = object_format(index, sub)
    bits = 8 * {"b": 1, "h": 2, "i": 4}[known.lower()] if known else None
    return Entry(index, sub, bits or 8 * len(objects.upload(index, sub)))


def _read_list(objects: ObjectAccess, index: int) -> list[int]:
    count = int.from_bytes(objects.upload(index, 0)[:1], "little")
    if count > MAX_ENTRIES:
        raise OperationError(f"object 0x{index:04X} has {count} entries, at most {MAX_ENTRIES}")
    return [int.from_bytes(objects.upload(index, sub), "little") for sub in range(1, count + 1)]


def _write_list(objects: ObjectAccess, index: int, numbers: Sequence[int], size: int) -> None:
    for sub, number in enumerate(numbers, start=1):
        objects.download(index, sub, number.to_bytes(size, "little"))
    objects.download(index, 0, bytes([len(numbers)]))
