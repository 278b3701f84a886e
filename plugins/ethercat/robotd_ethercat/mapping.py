"""PDO assignment and mapping of a slave, and its process data as integers."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import count
from typing import Protocol

from robotd.api import OperationError
from robotd_cia402.object_numbers import AXIS_STEP, PROFILE_AREA
from robotd_cia402.options import parse_object
from robotd_ethercat.options import PdoOptions

MAX_ENTRIES = 254  # of one assignment or PDO

# Types of the objects of CiA 402 and the communication area, as ``struct`` formats.
_TYPES = {
    "B": (0x1C00, 0x60C2),
    "b": (0x6060, 0x6061, 0x6098),
    "H": (0x603F, 0x6040, 0x6041, 0x6066, 0x6068, 0x606D, 0x606E, 0x6072, 0x6073),
    "h": (0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6071, 0x6074, 0x6077, 0x6078, 0x60B2),
    "I": (
        0x1000, 0x6065, 0x6067, 0x607F, 0x6080, 0x6081, 0x6083, 0x6084, 0x6085, 0x6087,
        0x6099, 0x609A, 0x60C5, 0x60C6, 0x60FD, 0x60FE, 0x6502,
    ),
    "i": (
        0x6062, 0x6063, 0x6064, 0x6069, 0x606B, 0x606C, 0x607A, 0x607B, 0x607C, 0x607D,
        0x60B0, 0x60B1, 0x60C1, 0x60F4, 0x60FA, 0x60FC, 0x60FF,
    ),
}  # fmt: skip
_FORMATS = {index: code for code, numbers in _TYPES.items() for index in numbers}
_BY_BITS = {8: "B", 16: "H", 32: "I", 64: "Q"}
_OF_SUB = {(0x60C2, 2): "b"}


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
        """Value of the entry in a mapping object."""
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


def object_format(index: int, sub: int = 0) -> str | None:
    """Format character of an object, on any axis of a drive; None: not known."""
    if index in PROFILE_AREA:
        index = PROFILE_AREA.start + (index - PROFILE_AREA.start) % AXIS_STEP
    return _OF_SUB.get((index, sub)) or _FORMATS.get(index)


def entry_format(index: int, sub: int, bits: int) -> str | None:
    """Format of a mapped object of ``bits``; None: no integer of whole bytes.

    The type of an object that is not known is unsigned.
    """
    known = object_format(index, sub)
    if known is not None and 8 * struct.calcsize(known) == bits:
        return known
    return _BY_BITS.get(bits)


class SlaveImage:
    """Inputs and outputs of a drive, by the mapping that it has.

    The control loop takes inputs and packs outputs; a worker changes the layout while no process
    data are exchanged.

    Attributes:
        inputs: values received last, in the order of the mapping; ``raw``: as they came.
        outputs: values to send, in the order of the mapping.
        input_slots, output_slots: (index, subindex) → place in these.
    """

    def __init__(self) -> None:
        self.inputs: Sequence[int] = ()
        self.raw = b""
        self.outputs: list[int] = []
        self.input_slots: dict[tuple[int, int], int] = {}
        self.output_slots: dict[tuple[int, int], int] = {}
        self._input = self._output = struct.Struct("")

    @property
    def input_size(self) -> int:
        """Bytes of the inputs."""
        return self._input.size

    @property
    def output_size(self) -> int:
        """Bytes of the outputs."""
        return self._output.size

    def set_layout(self, rx_pdos: Sequence[Pdo], tx_pdos: Sequence[Pdo]) -> None:
        """Take the mapping; all values are 0.

        Raises OperationError for an object that is misaligned, or mapped twice.
        """
        self._output, self.output_slots = _layout(rx_pdos)
        self._input, self.input_slots = _layout(tx_pdos)
        self.outputs = [0] * len(self.output_slots)
        self.inputs = (0,) * len(self.input_slots)

    def take(self, data: bytes) -> None:
        """Control loop: decode ``data``, ``input_size`` bytes."""
        self.raw, self.inputs = data, self._input.unpack(data)

    def pack(self) -> bytes:
        """Control loop: encode the outputs, ``output_size`` bytes."""
        return self._output.pack(*self.outputs)


def _layout(pdos: Sequence[Pdo]) -> tuple[struct.Struct, dict[tuple[int, int], int]]:
    """Format and slots; gaps and objects of other sizes are skipped in whole bytes."""
    formats, slots, numbers, skipped_bits = ["<"], dict[tuple[int, int], int](), count(), 0
    for pdo in pdos:
        for entry in pdo.entries:
            code = entry_format(entry.index, entry.sub, entry.bits) if entry.index else None
            if code is None:
                skipped_bits += entry.bits
                continue
            key = entry.index, entry.sub
            if key in slots:
                raise OperationError(f"PDO 0x{pdo.index:04X}: {entry} is in another PDO, too")
            formats.append(_gap(skipped_bits, pdo, entry) + code)
            skipped_bits = 0
            slots[key] = next(numbers)
    formats.append("x" * ((skipped_bits + 7) // 8))
    return struct.Struct("".join(formats)), slots


def _gap(bits: int, pdo: Pdo, entry: Entry) -> str:
    if bits % 8:
        raise OperationError(
            f"PDO 0x{pdo.index:04X}: {entry} begins inside a byte, after {bits % 8} bit;"
            " map a gap before it"
        )
    return "x" * (bits // 8)
