"""PDOs: defaults, layout by the object dictionary, and configuration of a node."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from canopen.objectdictionary import ObjectDictionary
from canopen.objectdictionary.datatypes import SIGNED_TYPES

from robotd.api import OperationError
from robotd_canopen.object_dictionary import describe, variable
from robotd_canopen.options import AxisOptions, IoOptions, PdoOptions
from robotd_canopen.sdo import Sdo
from robotd_cia402.modes import VELOCITY as VELOCITY_MODES
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import (
    INPUTS,
    INTERPOLATION,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
    on_axis,
)
from robotd_cia402.options import StreamMode, parse_object

MAX_BYTES = 8
MAX_SYNCHRONOUS = 240  # highest transmission type of a PDO that goes with SYNC
_EVENT = 255
_DISABLED = 1 << 31
_NO_RTR = 1 << 30
_FORMATS = {
    (8, False): "B", (16, False): "H", (32, False): "I", (64, False): "Q",
    (8, True): "b", (16, True): "h", (32, True): "i", (64, True): "q",
}  # fmt: skip

_MODES = {
    TARGET_POSITION: (OperationMode.PROFILE_POSITION, OperationMode.CYCLIC_POSITION),
    TARGET_VELOCITY: VELOCITY_MODES,
    TARGET_TORQUE: (OperationMode.CYCLIC_TORQUE,),
    INTERPOLATION: (OperationMode.INTERPOLATED_POSITION,),
}
"""Targets and the operation modes in which they matter."""


class Direction(IntEnum):
    """Seen from the node; the value is the index of its first communication parameter."""

    RECEIVE = 0x1400
    TRANSMIT = 0x1800


@dataclass(frozen=True)
class Entry:
    """One mapped object. ``base`` is its index without the axis offset."""

    index: int
    sub: int
    bits: int
    base: int

    @property
    def mapping(self) -> int:
        """As objects 0x1600 and 0x1A00 hold it."""
        return self.index << 16 | self.sub << 8 | self.bits


@dataclass(frozen=True)
class Pdo:
    """One PDO of a node. ``layout`` packs the entries in order, little endian."""

    direction: Direction
    number: int
    cob_id: int
    transmission: int
    entries: tuple[Entry, ...]
    layout: struct.Struct

    @property
    def parameter(self) -> int:
        """Index of the communication parameter; the mapping is 0x200 further."""
        return self.direction + self.number - 1

    @property
    def name(self) -> str:
        kind = "RPDO" if self.direction is Direction.RECEIVE else "TPDO"
        return f"{kind} {self.number}"

    @property
    def is_event_driven(self) -> bool:
        """The node sends it on an event of its own, not with SYNC."""
        return self.transmission > MAX_SYNCHRONOUS

    @property
    def inputs(self) -> list[Entry]:
        """Entries whose values an axis takes."""
        return [entry for entry in self.entries if entry.base in INPUTS]

    def holds(self, base: int) -> bool:
        """One of the entries is the object ``base``."""
        return any(entry.base == base for entry in self.entries)

    @property
    def modes(self) -> frozenset[int] | None:
        """Operation modes in which an object of this RPDO matters; None: in each."""
        bases = {entry.base for entry in self.entries}
        if bases - _MODES.keys():
            return None
        return frozenset(mode for base in bases for mode in _MODES[base])


def axis_pdos(options: AxisOptions) -> tuple[list[PdoOptions], list[PdoOptions]]:
    """RPDOs and TPDOs of an axis: the descriptor's, or the default of its modes."""
    receive = list(options.rpdos) or _default_rpdos(options)
    transmit = list(options.tpdos) or [
        PdoOptions(number=1, transmission=1, objects=("0x6041", "0x6061", "0x6064")),
        PdoOptions(number=2, transmission=1, objects=("0x606C", "0x6077", "0x603F")),
        PdoOptions(number=3, transmission=4, objects=("0x6062", "0x60FD")),
    ]
    return receive, transmit


def _default_rpdos(options: AxisOptions) -> list[PdoOptions]:
    if options.stream_mode is StreamMode.CSP:
        return [
            PdoOptions(number=1, transmission=1, objects=("0x6040", "0x6060", "0x607A")),
            PdoOptions(number=2, transmission=1, objects=("0x60FF",)),
        ]
    return [
        PdoOptions(number=1, transmission=1, objects=("0x6040", "0x6060", "0x60C1:1")),
        PdoOptions(number=2, transmission=1, objects=("0x60FF",)),
        PdoOptions(number=3, transmission=1, objects=("0x607A",)),
    ]


def io_pdos(options: IoOptions) -> tuple[list[PdoOptions], list[PdoOptions]]:
    """Outputs (RPDO 1) and inputs (TPDO 1) of a module, sent when they change."""

    def bits(index: int, length: int) -> list[PdoOptions]:
        objects = tuple(f"0x{index:04X}:{sub}" for sub in range(1, length + 1))
        return [PdoOptions(number=1, transmission=_EVENT, objects=objects)] if objects else []

    return bits(0x6200, options.output_length), bits(0x6000, options.input_length)


def resolve(
    pdo: PdoOptions,
    direction: Direction,
    node: int,
    dictionary: ObjectDictionary,
    axis_offset: int = 0,
) -> Pdo:
    """The layout by the node's dictionary. Raises ValueError with everything that is wrong."""
    problems: list[str] = []
    entries: list[Entry] = []
    layout = "<"
    for name in pdo.objects:
        base, sub = parse_object(name)
        index = on_axis(base, axis_offset)
        found = variable(dictionary, index, sub)
        if found is None:
            problems.append(f"object 0x{index:04X}:{sub:02X} is not in the EDS")
        elif not found.pdo_mappable or (len(found), False) not in _FORMATS:
            problems.append(f"object {describe(dictionary, index, sub)} cannot be mapped")
        else:
            entries.append(Entry(index, sub, len(found), base))
            layout += _FORMATS[len(found), found.data_type in SIGNED_TYPES]
    size = sum(entry.bits for entry in entries) // 8
    if size > MAX_BYTES:
        problems.append(f"{size} bytes do not fit in the {MAX_BYTES} of a PDO")
    cob_id = pdo.cob_id
    if cob_id is None and (pdo.number > 4 or axis_offset):
        problems.append("needs a cob_id: only PDOs 1 to 4 of a single axis have a predefined one")
    if problems:
        raise ValueError("; ".join(problems))
    predefined = 0x200 if direction is Direction.RECEIVE else 0x180
    return Pdo(
        direction,
        pdo.number,
        predefined + 0x100 * (pdo.number - 1) + node if cob_id is None else cob_id,
        pdo.transmission,
        tuple(entries),
        struct.Struct(layout),
    )


def configure(sdo: Sdo, pdo: Pdo) -> None:
    """Write communication and mapping parameters, and read the mapping back.

    In the order of CiA 301, 7.5.2.36: invalid, no entries, entries, count, valid again.
    """
    parameter, mapping = pdo.parameter, pdo.parameter + 0x200
    sdo.write(parameter, 1, pdo.cob_id | _DISABLED | _rtr(pdo))
    sdo.write(parameter, 2, pdo.transmission)
    sdo.write(mapping, 0, 0)
    for sub, entry in enumerate(pdo.entries, 1):
        sdo.write(mapping, sub, entry.mapping)
    sdo.write(mapping, 0, len(pdo.entries))
    _verify(sdo, pdo, mapping)
    sdo.write(parameter, 1, pdo.cob_id | _rtr(pdo))


def disable_others(sdo: Sdo, used: tuple[Pdo, ...]) -> None:
    """Make the predefined PDOs that are not ``used`` invalid."""
    taken = {pdo.parameter for pdo in used}
    for direction in Direction:
        for parameter in range(direction, direction + 4):
            if parameter in sdo.dictionary and parameter not in taken:
                sdo.write(parameter, 1, sdo.read(parameter, 1) | _DISABLED)


def _rtr(pdo: Pdo) -> int:
    return _NO_RTR if pdo.direction is Direction.TRANSMIT else 0


def _verify(sdo: Sdo, pdo: Pdo, mapping: int) -> None:
    expected = [len(pdo.entries), *(entry.mapping for entry in pdo.entries)]
    actual = [sdo.read(mapping, sub) for sub in range(len(expected))]
    if actual != expected:
        raise OperationError(
            f"{pdo.name}: the node maps {[hex(value) for value in actual]}, requested were"
            f" {[hex(value) for value in expected]}"
        )
