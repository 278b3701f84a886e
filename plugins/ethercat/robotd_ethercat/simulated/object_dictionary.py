"""CoE object dictionary: definitions of objects, and their values."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

Key = tuple[int, int]


class DataType(IntEnum):
    """Data types, numbers of CiA 301 and ETG.1000.6."""

    BOOLEAN = 0x01
    INTEGER8 = 0x02
    INTEGER16 = 0x03
    INTEGER32 = 0x04
    UNSIGNED8 = 0x05
    UNSIGNED16 = 0x06
    UNSIGNED32 = 0x07
    VISIBLE_STRING = 0x09
    OCTET_STRING = 0x0A


class ObjectCode(IntEnum):
    """Kinds of objects."""

    VAR = 7
    ARRAY = 8
    RECORD = 9


class Access(IntEnum):
    """Access bits of an entry: PreOp, SafeOp and Op, reading and writing, PDO mapping."""

    READ = 0x07
    WRITE = 0x38
    WRITE_PRE_OP = 0x08
    RX_PDO = 0x40
    TX_PDO = 0x80


READ_ONLY = int(Access.READ)
READ_WRITE = Access.READ | Access.WRITE
CONFIGURATION = Access.READ | Access.WRITE_PRE_OP
_FORMATS = {
    DataType.BOOLEAN: "<B",
    DataType.INTEGER8: "<b",
    DataType.INTEGER16: "<h",
    DataType.INTEGER32: "<i",
    DataType.UNSIGNED8: "<B",
    DataType.UNSIGNED16: "<H",
    DataType.UNSIGNED32: "<I",
}
_SIGNED = (DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER32)
_BYTES = {kind: struct.calcsize(code) for kind, code in _FORMATS.items()}


@dataclass(frozen=True)
class Entry:
    """One subindex.

    Attributes:
        kind: data type.
        access: bits of ``Access``.
        default: value at power-on; bytes for strings, which also set the maximum length.
        name: text for the SDO information service.
    """

    kind: DataType
    access: int
    default: int | bytes
    name: str

    @property
    def size(self) -> int:
        """Length in bytes."""
        return len(self.default) if isinstance(self.default, bytes) else _BYTES[self.kind]

    @property
    def bits(self) -> int:
        """Length in bits, in a PDO and in the SDO information."""
        return 1 if self.kind is DataType.BOOLEAN else 8 * self.size

    @property
    def signed(self) -> bool:
        """True for an integer with sign."""
        return self.kind in _SIGNED


@dataclass(frozen=True)
class ObjectDefinition:
    """One object with its entries, by subindex."""

    index: int
    code: ObjectCode
    name: str
    entries: dict[int, Entry]


class ObjectDictionary:
    """Objects of one slave. Integers are in ``values``, strings in ``data``.

    Attributes:
        values: every integer, by index and subindex; SDO, PDO and the application share it.
        data: every string.
    """

    def __init__(self, objects: Iterable[ObjectDefinition]) -> None:
        self.objects = {found.index: found for found in objects}
        self.values: dict[Key, int] = {}
        self.data: dict[Key, bytes] = {}
        self.reset()

    def reset(self) -> None:
        """Set the values of power-on."""
        for index, found in self.objects.items():
            for sub, entry in found.entries.items():
                if isinstance(entry.default, bytes):
                    self.data[index, sub] = entry.default
                else:
                    self.values[index, sub] = entry.default

    def entry(self, index: int, sub: int) -> Entry | None:
        """Return the definition of an entry; None if it does not exist."""
        found = self.objects.get(index)
        return None if found is None else found.entries.get(sub)

    def encode(self, index: int, sub: int) -> bytes:
        """Return the bytes of an existing entry, little-endian."""
        entry = self.objects[index].entries[sub]
        if isinstance(entry.default, bytes):
            return self.data[index, sub]
        return struct.pack(_FORMATS[entry.kind], self.values[index, sub])

    def decode(self, index: int, sub: int, data: bytes) -> None:
        """Set an existing entry from bytes of its length."""
        entry = self.objects[index].entries[sub]
        if isinstance(entry.default, bytes):
            self.data[index, sub] = data
        else:
            self.values[index, sub] = struct.unpack(_FORMATS[entry.kind], data)[0]


def variable(
    index: int, name: str, kind: DataType, default: int | bytes = 0, access: int = READ_ONLY
) -> ObjectDefinition:
    """Make an object with subindex 0 alone."""
    entry = Entry(kind, access, default, name)
    return ObjectDefinition(index, ObjectCode.VAR, name, {0: entry})


def record(
    index: int, name: str, *entries: Entry, count_access: int = READ_ONLY
) -> ObjectDefinition:
    """Make an object with subindices from 1; subindex 0 is their number."""
    count = Entry(DataType.UNSIGNED8, count_access, len(entries), "Number of entries")
    return ObjectDefinition(
        index, ObjectCode.RECORD, name, {0: count, **dict(enumerate(entries, start=1))}
    )
