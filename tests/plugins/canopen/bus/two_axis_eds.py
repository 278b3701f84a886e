"""EDS of a drive with two axes, made from the generic one."""

from __future__ import annotations

from configparser import RawConfigParser
from importlib.resources import files
from pathlib import Path

SECOND_AXIS = 0x800
SECOND_PDOS = 0x40  # PDO 65 is the first of the second axis (CiA 402-1)
PDO_PARAMETERS = range(0x1400, 0x1C00)


def write_two_axis_eds(path: Path) -> Path:
    """Write it to ``path`` and return that."""
    eds = RawConfigParser()
    eds.optionxform = str  # type: ignore[method-assign, assignment] # keys as they are
    eds.read_string((files("robotd_canopen") / "eds" / "generic_402.eds").read_text())
    added = []
    for name in eds.sections():
        number, sub, rest = name[:4], name[4:7], name[7:]
        if not all(digit in "0123456789ABCDEF" for digit in number) or sub not in ("", "sub"):
            continue
        index = int(number, 16)
        if index in PDO_PARAMETERS:
            index += SECOND_PDOS
        elif 0x6000 <= index < 0x6000 + SECOND_AXIS:
            index += SECOND_AXIS
        else:
            continue
        eds[f"{index:04X}{sub}{rest}"] = dict(eds[name])
        added += [] if sub else [index]
    optional = eds["OptionalObjects"]
    count = int(optional["SupportedObjects"])
    optional.update({str(count + place): f"0x{index:04X}" for place, index in enumerate(added, 1)})
    optional["SupportedObjects"] = str(count + len(added))
    with path.open("w", encoding="utf-8") as file:
        eds.write(file, space_around_delimiters=False)
    return path
