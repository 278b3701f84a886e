"""Numbers of profile objects (CiA 402-2), and their place on the axes of a drive."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

CONTROLWORD, STATUSWORD = 0x6040, 0x6041
MODE, MODE_DISPLAY = 0x6060, 0x6061
DEMAND, POSITION, VELOCITY, TORQUE = 0x6062, 0x6064, 0x606C, 0x6077
TARGET_POSITION, TARGET_VELOCITY, TARGET_TORQUE = 0x607A, 0x60FF, 0x6071
INTERPOLATION = 0x60C1
ERROR_CODE, SWITCHES = 0x603F, 0x60FD

INPUTS = (STATUSWORD, MODE_DISPLAY, POSITION, DEMAND, VELOCITY, TORQUE, ERROR_CODE, SWITCHES)
"""Objects that an axis takes from the cyclic frames, in the order of ``DriveAccess.values``."""
OUTPUTS = (CONTROLWORD, MODE, TARGET_POSITION, TARGET_VELOCITY, TARGET_TORQUE, INTERPOLATION)
"""Objects that an axis puts into the cyclic frames, in the order of ``DriveAccess.put``."""

POSITIONS = (POSITION, DEMAND, TARGET_POSITION, INTERPOLATION)
"""Objects that are positions; INTEGER32 in CiA 402-2."""
_POSITION_BITS = 32

AXIS_STEP = 0x800  # distance of the profile objects of two axes in one drive (CiA 402-1)
PROFILE_AREA = range(0x6000, 0xA000)


def on_axis(index: int, axis_offset: int) -> int:
    """The number of a profile object on one axis of a multi-axis drive."""
    return index + axis_offset * AXIS_STEP if index in PROFILE_AREA else index


def narrow_positions(entries: Iterable[tuple[int, int, int]]) -> Iterator[str]:
    """Yield what is wrong with positions that wrap earlier than those of CiA 402-2.

    Args:
        entries: number in the profile, index and bits of each object in the PDOs.
    """
    for base, index, bits in entries:
        if base in POSITIONS and bits != _POSITION_BITS:
            yield (
                f"object 0x{index:04X} (position) has {bits} bits in the PDOs, robotd needs"
                f" {_POSITION_BITS}, as in CiA 402-2: these would wrap after {1 << bits} counts;"
                " use a firmware or a profile of the drive that has them"
            )
