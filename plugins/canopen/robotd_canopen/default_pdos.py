"""PDOs of an axis that the descriptor gives none: chosen by what the EDS offers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from canopen.objectdictionary import ObjectDictionary, ODVariable

from robotd_canopen.object_dictionary import variable
from robotd_canopen.options import PDO_COB_IDS, AxisOptions, PdoOptions
from robotd_canopen.pdo import MAX_BYTES, MAX_SYNCHRONOUS, Direction, constant_mapping
from robotd_cia402.guiding import is_guided
from robotd_cia402.object_numbers import (
    CONTROLWORD,
    DEMAND,
    ERROR_CODE,
    INTERPOLATION,
    MODE,
    MODE_DISPLAY,
    OUTPUTS,
    POSITION,
    STATUSWORD,
    SWITCHES,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
    TORQUE,
    VELOCITY,
    on_axis,
)
from robotd_cia402.options import SetpointMode

LOST = {
    ERROR_CODE: "an alarm is explained by the node's emergency message only",
    TORQUE: "no measured torque",
    VELOCITY: "the velocity is computed from positions",
    DEMAND: "the position demand is taken to be the measured position",
    SWITCHES: "limit and home switches read open",
    TARGET_VELOCITY: "no velocity commands",
    MODE: "the mode is changed by SDO, at rest only, and there are no streams of torques",
    MODE_DISPLAY: "the mode is read back by SDO, when it is changed and when a motion begins",
}
"""Optional objects of the default PDOs, and what is lost without each."""

_NUMBERS = range(1, 5)  # PDOs with a predefined COB-ID
_MAX_ENTRIES = 8
_SUBS = {INTERPOLATION: 1}

_Group = tuple[int, Sequence[int]]  # transmission type, and objects that are sent together
_TRANSMIT: Sequence[_Group] = (
    (1, (STATUSWORD, MODE_DISPLAY, POSITION)),
    (1, (VELOCITY, TORQUE, ERROR_CODE)),
    (4, (DEMAND, SWITCHES)),
)
_RECEIVE: dict[SetpointMode, Sequence[_Group]] = {
    SetpointMode.CSP: ((1, (CONTROLWORD, MODE, TARGET_POSITION)), (1, (TARGET_VELOCITY,))),
    SetpointMode.IP: (
        (1, (CONTROLWORD, MODE, INTERPOLATION)),
        (1, (TARGET_VELOCITY,)),
        (1, (TARGET_POSITION,)),
    ),
}


@dataclass(frozen=True)
class DefaultPdos:
    """Default PDOs of one direction, and the optional objects that they do not hold."""

    pdos: tuple[PdoOptions, ...]
    left_out: tuple[int, ...]


def default_pdos(
    options: AxisOptions, direction: Direction, dictionary: ObjectDictionary
) -> DefaultPdos:
    """Return PDOs for the objects that the EDS has and lets be mapped.

    Where too few mappings can be written, PDOs with a constant one are taken as they are.
    """
    receives = direction is Direction.RECEIVE
    groups = list(_RECEIVE[options.stream_mode] if receives else _TRANSMIT)
    if receives and is_guided(options):
        groups.append((1, (TARGET_TORQUE,)))
    wanted = [base for _, bases in groups for base in bases]
    packed = _packed(groups, direction, dictionary, options.axis_offset)
    needed = [base for base in wanted if base not in LOST]
    with_mode = [*needed, *(base for base in wanted if base in (MODE, MODE_DISPLAY))]
    constant = _constant(direction, dictionary, wanted)
    candidates = [(packed, with_mode), (constant, with_mode), (packed, needed), (constant, needed)]
    usable = [pdos for pdos, bases in candidates if _holds(pdos, bases)]
    packed = usable[0] if usable else packed or constant
    left_out = [base for base in wanted if base in LOST and not _holds(packed, [base])]
    return DefaultPdos(tuple(packed), tuple(left_out))


def _packed(
    groups: Iterable[_Group], direction: Direction, dictionary: ObjectDictionary, offset: int
) -> list[PdoOptions]:
    """Return PDOs with the objects of the groups, each as full as it may be."""
    numbers = [number for number in _NUMBERS if _is_writable(direction, number, dictionary)]
    pdos: list[PdoOptions] = []
    for transmission, bases in groups:
        room = size = number = 0
        names: list[str] = []
        for base in bases:
            found = variable(dictionary, on_axis(base, offset), _SUBS.get(base, 0))
            if base in LOST and (found is None or not found.pdo_mappable):
                continue
            bits = 32 if found is None else len(found)
            if not room or size + bits > 8 * MAX_BYTES:
                if names:
                    pdos.append(_pdo(number, transmission, names))
                    names = []
                if not numbers:
                    break
                number = numbers.pop(0)
                room, size = _room(direction, number, dictionary), 0
            names.append(_name(base, _SUBS.get(base, 0)))
            room, size = room - 1, size + bits
        if names:
            pdos.append(_pdo(number, transmission, names))
    return pdos


def _constant(
    direction: Direction, dictionary: ObjectDictionary, wanted: Sequence[int]
) -> list[PdoOptions]:
    """Return the fewest PDOs with a constant mapping that hold the wanted objects.

    An RPDO with an object that robotd does not set would set it to 0.
    """
    known = OUTPUTS if direction is Direction.RECEIVE else None
    found: dict[int, set[int]] = {}
    pdos: dict[int, PdoOptions] = {}
    for number in _NUMBERS:
        entries = constant_mapping(dictionary, direction, number)
        bases = {index for index, _ in entries}
        if not bases or (known and not bases <= set(known)):
            continue
        found[number] = bases & set(wanted)
        parameter = direction + number - 1
        transmission, cob_id = (variable(dictionary, parameter, sub) for sub in (2, 1))
        pdos[number] = PdoOptions(
            number=number,
            transmission=_fixed(transmission, range(1, MAX_SYNCHRONOUS + 1)) or 1,
            cob_id=_fixed(cob_id, PDO_COB_IDS),
            objects=tuple(_name(index, sub) for index, sub in entries),
        )
    for number in reversed(found):  # without those whose objects are in others
        others = [bases for other, bases in found.items() if other != number and other in pdos]
        if found[number] <= set().union(*others):
            del pdos[number]
    return list(pdos.values())


def _is_writable(direction: Direction, number: int, dictionary: ObjectDictionary) -> bool:
    """Return whether the PDO can be mapped: any, if the EDS has no PDOs."""
    if not any(direction + number - 1 in dictionary for number in _NUMBERS):
        return True
    count = variable(dictionary, direction + 0x200 + number - 1, 0)
    in_eds = direction + number - 1 in dictionary
    return in_eds and (count is None or count.writable)


def _room(direction: Direction, number: int, dictionary: ObjectDictionary) -> int:
    """Return how many objects the PDO can map."""
    mapping = direction + 0x200 + number - 1
    subs = [sub for sub in range(1, _MAX_ENTRIES + 1) if variable(dictionary, mapping, sub)]
    return len(subs) or _MAX_ENTRIES


def _fixed(found: ODVariable | None, usable: Collection[int]) -> int | None:
    """Return the value of a read-only parameter; None where it is not usable."""
    if found is None or found.writable or not isinstance(found.default, int):
        return None
    value = found.default & 0x7FF
    return value if value in usable else None


def _pdo(number: int, transmission: int, names: Sequence[str]) -> PdoOptions:
    return PdoOptions(number=number, transmission=transmission, objects=tuple(names))


def _name(index: int, sub: int) -> str:
    return f"0x{index:04X}:{sub}" if sub else f"0x{index:04X}"


def _holds(pdos: Iterable[PdoOptions], wanted: Iterable[int]) -> bool:
    """Return whether the PDOs hold the objects."""
    held = {int(name.partition(":")[0], 16) for pdo in pdos for name in pdo.objects}
    return held.issuperset(wanted)
