"""Axes of a drive, as it describes them itself: supported modes and position units."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from robotd.api import RobotdError
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import AXIS_STEP

MAX_AXES = 8  # of one drive
SAME = 1e-6  # part; scales that differ by less are the same

Read = Callable[[int, int], int]
"""Reads object index:sub as an unsigned number. Raises RobotdError where there is none."""


@dataclass(frozen=True)
class FoundAxis:
    """One axis of a drive.

    Attributes:
        offset: place in a multi-axis drive, from 0.
        modes: supported modes of operation.
        scales: as ``stated_scales``.
    """

    offset: int
    modes: tuple[OperationMode, ...]
    scales: Mapping[str, float] = field(default_factory=dict)

    @property
    def counts_per_turn(self) -> float | None:
        """Position units of one turn of the shaft behind the gear; None: not stated."""
        return next(iter(self.scales.values()), None)

    @property
    def scale_keys(self) -> dict[str, Any]:
        """Keys of a scanned axis: ``counts_per_rad``, and a remark where the objects disagree."""
        turn = self.counts_per_turn
        if turn is None:
            return {}
        keys: dict[str, Any] = {"counts_per_rad": turn / (2.0 * math.pi)}
        if max(self.scales.values()) > (1.0 + SAME) * min(self.scales.values()):
            stated = ", ".join(f"{scale:.10g} ({name})" for name, scale in self.scales.items())
            keys["remark"] = f"scale in doubt, the drive states for a turn {stated}: measure it"
        return keys


def read_axes(read: Read) -> tuple[FoundAxis, ...]:
    """Ask a CiA 402 drive for its axes; at least one."""
    return tuple(_axes(read))


def stated_scales(read: Read, offset: int = 0) -> dict[str, float]:
    """Return position units of one turn, by the objects that state it.

    The turn is that of the shaft behind the gear. By CiA 402-2 the position is internal increments
    · 0x6092 / (0x608F · 0x6091), and one turn is the feed constant 0x6092. A drive without it, or
    with its default of 1, counts increments. There are drives that have it for reference only:
    where both are given and differ, only a motion can tell which counts.
    """
    step = offset * AXIS_STEP

    def ratio(index: int) -> float:
        numerator, denominator = (read_or_zero(read, index + step, sub) for sub in (1, 2))
        return numerator / (denominator or 1)

    feed, increments = ratio(0x6092), ratio(0x608F) * (ratio(0x6091) or 1.0)
    scales = {"0x6092": feed if feed > 1.0 else 0.0, "0x608F x 0x6091": increments}
    return {objects: scale for objects, scale in scales.items() if scale}


def read_or_zero(read: Read, index: int, sub: int) -> int:
    """Return an object as an unsigned number; 0 where there is none."""
    try:
        return read(index, sub)
    except RobotdError:
        return 0


def _axes(read: Read) -> Iterator[FoundAxis]:
    for offset in range(MAX_AXES):
        step = offset * AXIS_STEP
        supported = read_or_zero(read, 0x6502 + step, 0)
        if not supported and offset:
            return
        modes = tuple(mode for mode in OperationMode if mode and supported & mode.support_bit)
        yield FoundAxis(offset, modes, stated_scales(read, offset))
