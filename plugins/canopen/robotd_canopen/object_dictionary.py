"""Object dictionaries from EDS files, names of objects for error texts, and the values of a DCF."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.objectdictionary.datatypes import BOOLEAN, INTEGER_TYPES, REAL32, REAL64

from robotd.api import read_limited
from robotd_canopen.eds_reader import parse_eds
from robotd_canopen.options import AxisOptions, NodeOptions
from robotd_cia402.object_numbers import AXIS_STEP, OUTPUTS, PROFILE_AREA, on_axis
from robotd_cia402.options import parse_object

GENERIC_DRIVE = "generic_402.eds"
GENERIC_IO = "generic_401.eds"
MAX_BYTES = 2_000_000  # of an EDS file; the generic drive has 40 kB
_COMMUNICATION = range(0x1000, 0x2000)
_ERROR_BEHAVIOUR = 0x1029  # the only communication object that robotd does not set itself
_FLOATS = {REAL32: "<f", REAL64: "<d"}


def eds_path(eds: Path | None, folder: Path | None, generic: str) -> Path:
    """Return the EDS file of a node, relative to ``folder``; the generic one for None."""
    if eds is None:
        return Path(str(files("robotd_canopen") / "eds" / generic))
    return folder / eds if folder is not None else eds


@lru_cache(maxsize=64)
def read_eds(path: Path, node: int) -> ObjectDictionary:
    """The dictionary of ``node``. Raises DescriptorError. Any thread."""
    return parse_eds(read_limited(path, MAX_BYTES), path, node)


def empty_dictionary() -> ObjectDictionary:
    """Return a dictionary without objects, for a node without an EDS file."""
    return ObjectDictionary()  # type: ignore[no-untyped-call]


def variable(dictionary: ObjectDictionary, index: int, sub: int) -> ODVariable | None:
    """One object; None when the dictionary does not have it."""
    try:
        found = dictionary[index]
        return found if isinstance(found, ODVariable) else found[sub]
    except KeyError:
        return None


def describe(dictionary: ObjectDictionary, index: int, sub: int) -> str:
    """``0x1017:00 (Producer heartbeat time)``."""
    found = variable(dictionary, index, sub)
    name = f" ({found.name})" if found is not None else ""
    return f"0x{index:04X}:{sub:02X}{name}"


def startup_writes(options: NodeOptions) -> list[tuple[int, int, int]]:
    """Index, subindex and value of each start-up object, on the node's own axis."""
    offset = options.axis_offset if isinstance(options, AxisOptions) else 0
    objects = [(*parse_object(write.object), write.value) for write in options.startup]
    return [(on_axis(index, offset), sub, value) for index, sub, value in objects]


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
