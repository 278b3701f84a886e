"""Object dictionary of a simulated drive: the profile objects of its first axis."""

from __future__ import annotations

from dataclasses import dataclass

Objects = dict[tuple[int, int], int]
"""Object (index, subindex) → value, signed if its type is."""

AXIS_STEP = 0x800  # from one axis of a drive to the next (CiA 402-1)
I8, I16, I32 = (8, True), (16, True), (32, True)
U8, U16, U32 = (8, False), (16, False), (32, False)


@dataclass(frozen=True)
class DriveObject:
    """One object of CiA 402-2.

    Attributes:
        name: as in the profile; of a subindex its own.
        kind: size in bits, and True for a signed integer.
        default: value at power-on.
        writable: from the master's side.
    """

    index: int
    sub: int
    name: str
    kind: tuple[int, bool]
    default: int
    writable: bool


# fmt: off
DRIVE_OBJECTS = (
    DriveObject(0x6007, 0, "Abort connection option code", I16, 1, writable=True),
    DriveObject(0x603F, 0, "Error code", U16, 0, writable=False),
    DriveObject(0x6040, 0, "Controlword", U16, 0, writable=True),
    DriveObject(0x6041, 0, "Statusword", U16, 0, writable=False),
    DriveObject(0x605A, 0, "Quick stop option code", I16, 2, writable=True),
    DriveObject(0x605B, 0, "Shutdown option code", I16, 0, writable=True),
    DriveObject(0x605C, 0, "Disable operation option code", I16, 1, writable=True),
    DriveObject(0x605D, 0, "Halt option code", I16, 1, writable=True),
    DriveObject(0x605E, 0, "Fault reaction option code", I16, 2, writable=True),
    DriveObject(0x6060, 0, "Modes of operation", I8, 0, writable=True),
    DriveObject(0x6061, 0, "Modes of operation display", I8, 0, writable=False),
    DriveObject(0x6062, 0, "Position demand value", I32, 0, writable=False),
    DriveObject(0x6064, 0, "Position actual value", I32, 0, writable=False),
    DriveObject(0x6065, 0, "Following error window", U32, 0xFFFFFFFF, writable=True),
    DriveObject(0x6066, 0, "Following error time out", U16, 0, writable=True),
    DriveObject(0x6067, 0, "Position window", U32, 100, writable=True),
    DriveObject(0x6068, 0, "Position window time", U16, 0, writable=True),
    DriveObject(0x606C, 0, "Velocity actual value", I32, 0, writable=False),
    DriveObject(0x6071, 0, "Target torque", I16, 0, writable=True),
    DriveObject(0x6072, 0, "Max torque", U16, 3000, writable=True),
    DriveObject(0x6076, 0, "Motor rated torque", U32, 1000, writable=True),
    DriveObject(0x6077, 0, "Torque actual value", I16, 0, writable=False),
    DriveObject(0x607A, 0, "Target position", I32, 0, writable=True),
    DriveObject(0x607C, 0, "Home offset", I32, 0, writable=True),
    DriveObject(0x607D, 0, "Highest sub-index", U8, 2, writable=False),
    DriveObject(0x607D, 1, "Min position limit", I32, -2147483648, writable=True),
    DriveObject(0x607D, 2, "Max position limit", I32, 2147483647, writable=True),
    DriveObject(0x607F, 0, "Max profile velocity", U32, 0x7FFFFFFF, writable=True),
    DriveObject(0x6081, 0, "Profile velocity", U32, 100000, writable=True),
    DriveObject(0x6083, 0, "Profile acceleration", U32, 1000000, writable=True),
    DriveObject(0x6084, 0, "Profile deceleration", U32, 1000000, writable=True),
    DriveObject(0x6085, 0, "Quick stop deceleration", U32, 5000000, writable=True),
    DriveObject(0x6086, 0, "Motion profile type", I16, 0, writable=True),
    DriveObject(0x6098, 0, "Homing method", I8, 0, writable=True),
    DriveObject(0x6099, 0, "Highest sub-index", U8, 2, writable=False),
    DriveObject(0x6099, 1, "Speed during search for switch", U32, 10000, writable=True),
    DriveObject(0x6099, 2, "Speed during search for zero", U32, 1000, writable=True),
    DriveObject(0x609A, 0, "Homing acceleration", U32, 1000000, writable=True),
    DriveObject(0x60B1, 0, "Velocity offset", I32, 0, writable=True),
    DriveObject(0x60B2, 0, "Torque offset", I16, 0, writable=True),
    DriveObject(0x60C0, 0, "Interpolation sub mode select", I16, 0, writable=True),
    DriveObject(0x60C1, 0, "Highest sub-index", U8, 1, writable=False),
    DriveObject(0x60C1, 1, "Set-point", I32, 0, writable=True),
    DriveObject(0x60C2, 0, "Highest sub-index", U8, 2, writable=False),
    DriveObject(0x60C2, 1, "Interpolation time period value", U8, 4, writable=True),
    DriveObject(0x60C2, 2, "Interpolation time index", I8, -3, writable=True),
    DriveObject(0x60F4, 0, "Following error actual value", I32, 0, writable=False),
    DriveObject(0x60FD, 0, "Digital inputs", U32, 0, writable=False),
    DriveObject(0x60FF, 0, "Target velocity", I32, 0, writable=True),
    DriveObject(0x6502, 0, "Supported drive modes", U32, 0x3E5, writable=False),
)
# fmt: on
"""All objects of an axis; those of axis n of a drive are n times 0x800 further."""


def drive_defaults(axes: int = 1) -> Objects:
    """Return the values of a drive with ``axes`` axes at power-on."""
    return {
        (entry.index + AXIS_STEP * axis, entry.sub): entry.default
        for axis in range(axes)
        for entry in DRIVE_OBJECTS
    }
