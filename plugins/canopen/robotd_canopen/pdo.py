"""PDOs: layout by the object dictionary, and configuration of a node."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum

from canopen.objectdictionary import ObjectDictionary
from canopen.objectdictionary.datatypes import SIGNED_TYPES

from robotd.api import OperationError
from robotd_canopen.object_dictionary import describe, variable
from robotd_canopen.options import IoOptions, PdoOptions
from robotd_canopen.sdo import Sdo
from robotd_cia402.drive_access import SdoAbort
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
from robotd_cia402.options import parse_object

MAX_BYTES = 8
MAX_SYNCHRONOUS = 240  # highest transmission type of a PDO that goes with SYNC
_EVENT = 255
_DISABLED = 1 << 31
_NO_RTR = 1 << 30
_COMPARED = 0xFFFFFFFF & ~_NO_RTR  # of a COB-ID; there are no remote requests
_READ_ONLY = 0x06010002  # abort code
_MAX_ENTRIES = 64  # that a mapping can have; more are special kinds of PDOs
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
        """Value of the entry in the objects 0x1600 and 0x1A00."""
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
    constant = constant_mapping(dictionary, direction, pdo.number)
    if constant and constant != [(entry.index, entry.sub) for entry in entries] and not problems:
        held = ", ".join(f"0x{index:04X}:{sub}" for index, sub in constant)
        problems.append(f"the EDS gives its mapping as constant, with the objects {held}")
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


def constant_mapping(
    dictionary: ObjectDictionary, direction: Direction, number: int
) -> list[tuple[int, int]]:
    """Return the objects of a PDO whose mapping the EDS gives as constant; empty otherwise."""
    mapping = direction + 0x200 + number - 1
    count = variable(dictionary, mapping, 0)
    if count is None or count.writable or not isinstance(count.default, int):
        return []
    entries = [variable(dictionary, mapping, sub) for sub in range(1, min(count.default, 64) + 1)]
    values = [entry.default if entry is not None else None for entry in entries]
    if any(not isinstance(value, int) or not value for value in values):
        return []
    return [(value >> 16, value >> 8 & 0xFF) for value in values if value]


def configure(sdo: Sdo, pdo: Pdo) -> None:
    """Write the communication and mapping parameters that differ, and read the mapping back.

    In the order of CiA 301, 7.5.2.36: invalid, no entries, entries, count, valid again. Objects
    that are as they should be are not written: many devices have constant ones.
    """
    parameter = pdo.parameter
    is_mapped = _is_mapped(sdo, pdo)
    is_enabled = is_mapped and sdo.read(parameter, 1) & _COMPARED == pdo.cob_id
    if not is_enabled:
        sdo.write(parameter, 1, pdo.cob_id | _DISABLED | _rtr(pdo))
    if not is_mapped or sdo.read(parameter, 2) != pdo.transmission:
        sdo.write(parameter, 2, pdo.transmission)
    if not is_mapped:
        _map(sdo, pdo)
    if not is_enabled:
        sdo.write(parameter, 1, pdo.cob_id | _rtr(pdo))


def _is_mapped(sdo: Sdo, pdo: Pdo) -> bool:
    """Return whether the node has the mapping; read up to the first difference."""
    mapping = pdo.parameter + 0x200
    return sdo.read(mapping, 0) == len(pdo.entries) and all(
        sdo.read(mapping, sub) == entry.mapping for sub, entry in enumerate(pdo.entries, 1)
    )


def _map(sdo: Sdo, pdo: Pdo) -> None:
    """Write the mapping of an invalid PDO, and read it back."""
    mapping = pdo.parameter + 0x200
    try:
        sdo.write(mapping, 0, 0)
        for sub, entry in enumerate(pdo.entries, 1):
            sdo.write(mapping, sub, entry.mapping)
        sdo.write(mapping, 0, len(pdo.entries))
    except SdoAbort as error:
        if error.code == _READ_ONLY:
            error.reason += f"; {pdo.name} is constant and holds {_mapped_names(sdo, mapping)}"
            error.reason += ": give these"
        raise
    if not _is_mapped(sdo, pdo):
        requested = _names(entry.mapping for entry in pdo.entries)
        raise OperationError(
            f"{pdo.name}: the node maps {_mapped_names(sdo, mapping)}, requested were {requested}"
        )


def disable_others(sdo: Sdo, used: tuple[Pdo, ...]) -> Iterator[str]:
    """Make the predefined PDOs that are not ``used`` invalid; yield why one stays valid."""
    taken = {pdo.parameter for pdo in used}
    for direction in Direction:
        for parameter in range(direction, direction + 4):
            if parameter not in sdo.dictionary or parameter in taken:
                continue
            cob_id = sdo.read(parameter, 1)
            if not cob_id & _DISABLED:
                try:
                    sdo.write(parameter, 1, cob_id | _DISABLED)
                except SdoAbort as error:
                    yield error.reason


def _rtr(pdo: Pdo) -> int:
    return _NO_RTR if pdo.direction is Direction.TRANSMIT else 0


def _mapped_names(sdo: Sdo, mapping: int) -> str:
    count = min(sdo.read(mapping, 0), _MAX_ENTRIES)
    return _names(sdo.read(mapping, sub) for sub in range(1, count + 1))


def _names(entries: Iterable[int]) -> str:
    names = [f"0x{entry >> 16:04X}:{entry >> 8 & 0xFF:02X}" for entry in entries]
    return ", ".join(names) or "nothing"
