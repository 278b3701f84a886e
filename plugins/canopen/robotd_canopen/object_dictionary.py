"""Object dictionaries from EDS files, and names of objects for error texts."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from canopen.objectdictionary import ObjectDictionary, ODVariable

from robotd.api import read_limited
from robotd_canopen.eds_reader import parse_eds
from robotd_canopen.options import AxisOptions, NodeOptions
from robotd_cia402.object_numbers import on_axis
from robotd_cia402.options import parse_object

GENERIC_DRIVE = "generic_402.eds"
GENERIC_IO = "generic_401.eds"
MAX_BYTES = 2_000_000  # of an EDS file; the generic drive has 40 kB


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
