"""Values of a DCF (``ParameterValue``) that are written to a node at start."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.objectdictionary.datatypes import BOOLEAN, INTEGER_TYPES, REAL32, REAL64

from robotd_canopen.object_dictionary import describe
from robotd_cia402.object_numbers import AXIS_STEP, OUTPUTS, PROFILE_AREA

_COMMUNICATION = range(0x1000, 0x2000)
_ERROR_BEHAVIOUR = 0x1029  # the only communication object that robotd does not set itself
_FLOATS = {REAL32: "<f", REAL64: "<d"}


@dataclass(frozen=True)
class DcfValue:
    """One value of a DCF; ``skipped``: why it is not written, "" if it is."""

    index: int
    sub: int
    name: str
    text: str
    data: bytes = b""
    is_readable: bool = True
    skipped: str = ""


def dcf_values(dictionary: ObjectDictionary) -> list[DcfValue]:
    """Return the values of a DCF, sorted by object; none of an EDS."""
    return [
        _value(dictionary, found) for found in _variables(dictionary) if found.value is not None
    ]


def _variables(dictionary: ObjectDictionary) -> Iterator[ODVariable]:
    for index in sorted(dictionary.indices):
        found = dictionary.indices[index]
        if isinstance(found, ODVariable):
            yield found
        else:
            yield from (found.subindices[sub] for sub in sorted(found.subindices))


def _value(dictionary: ObjectDictionary, found: ODVariable) -> DcfValue:
    name = describe(dictionary, found.index, found.subindex)
    place = found.index, found.subindex, name, str(found.value)
    if reason := _reason_to_skip(found):
        return DcfValue(*place, skipped=reason)
    try:
        data = _packed(found)
    except (OverflowError, struct.error):
        return DcfValue(*place, skipped=f"does not fit in {len(found) // 8} bytes")
    return DcfValue(*place, data=data, is_readable=found.readable)


def _reason_to_skip(found: ODVariable) -> str:
    if not found.writable:
        return "read-only"
    if found.index in _COMMUNICATION and found.index != _ERROR_BEHAVIOUR:
        return "communication is configured by robotd"
    profile = PROFILE_AREA.start + (found.index - PROFILE_AREA.start) % AXIS_STEP
    if found.index in PROFILE_AREA and profile in OUTPUTS:
        return "a command, which is sent in each frame"
    if found.data_type not in (*INTEGER_TYPES, *_FLOATS, BOOLEAN):
        return "no number"
    return ""


def _packed(found: ODVariable) -> bytes:
    """Return the value as it is transferred. Raises OverflowError, struct.error."""
    value = found.value or 0
    if found.data_type in _FLOATS and isinstance(value, float):  # else its bits
        return struct.pack(_FLOATS[found.data_type], value)
    size = 1 if found.data_type == BOOLEAN else len(found) // 8
    return int(value).to_bytes(size, "little", signed=value < 0)
