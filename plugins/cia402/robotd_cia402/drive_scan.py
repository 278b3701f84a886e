"""Axes of a drive, as it describes them itself: supported modes and encoder scale."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from robotd.api import RobotdError
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import AXIS_STEP

MAX_AXES = 8  # of one drive

Read = Callable[[int, int], int]
"""Reads object index:sub as an unsigned number. Raises RobotdError where there is none."""


@dataclass(frozen=True)
class FoundAxis:
    """One axis of a drive.

    Attributes:
        offset: place in a multi-axis drive, from 0.
        modes: supported modes of operation.
        counts_per_turn: encoder counts of one turn of the shaft behind the gear; None: not stated.
    """

    offset: int
    modes: tuple[OperationMode, ...]
    counts_per_turn: float | None


def read_axes(read: Read) -> tuple[FoundAxis, ...]:
    """Ask a CiA 402 drive for its axes; at least one."""
    return tuple(_axes(read))


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
        yield FoundAxis(offset, modes, _counts_per_turn(read, step))


def _counts_per_turn(read: Read, step: int) -> float | None:
    """Return increments / motor turn · motor turns / shaft turn (CiA 402-2, 0x608F, 0x6091)."""
    increments, turns = (read_or_zero(read, 0x608F + step, sub) for sub in (1, 2))
    if not increments or not turns:
        return None
    motor, shaft = (read_or_zero(read, 0x6091 + step, sub) or 1 for sub in (1, 2))
    return increments / turns * motor / shaft
