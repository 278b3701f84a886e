"""Types of the objects of CiA 402 and the communication area, as ``struct`` formats."""

from __future__ import annotations

import struct

from robotd_cia402.object_numbers import AXIS_STEP, PROFILE_AREA

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
