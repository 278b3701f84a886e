"""Scanned drives and modules as sections of a robot, for ``robotd new-robot --bus``."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from robotd.api import RobotdError
from robotd_cia402.modes import STREAM_MODES, VELOCITY_MODES, OperationMode
from robotd_cia402.object_numbers import AXIS_STEP

DRIVE, MODULE = 402, 401  # device profiles, the low half of object 0x1000
MAX_AXES = 8  # of one drive
AXIS_BITS = 530  # on the wire for each SYNC, with the default PDOs
BUS_LOAD = 0.85  # leaves a margin below ``max_bus_load``
CYCLE_S = 0.002  # of a robot with the default rate; a SYNC takes a whole number of them

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


@dataclass(frozen=True)
class FoundModule:
    """Size of an I/O module in bytes."""

    inputs: int
    outputs: int


def read_axes(read: Read) -> tuple[FoundAxis, ...]:
    """Ask a CiA 402 node for its axes."""
    return tuple(_axes(read))


def read_module(read: Read) -> FoundModule:
    """Ask a CiA 401 node for its size."""
    return FoundModule(_number(read, 0x6000, 0), _number(read, 0x6200, 0))


def axis_section(node: int, identity: tuple[int, ...], axis: FoundAxis) -> dict[str, Any]:
    """Return the keys of ``backends.canopen.axes[]`` that the scan knows."""
    section: dict[str, Any] = {"node": node, "identity": _identity(identity)}
    if axis.offset:
        section["axis_offset"] = axis.offset
    modes = set(axis.modes)
    if not modes.isdisjoint(STREAM_MODES.values()):
        stream = next(key for key, mode in STREAM_MODES.items() if mode in modes)
        section["stream_mode"] = stream.value
    if not modes.isdisjoint(VELOCITY_MODES.values()):
        velocity = next(key for key, mode in VELOCITY_MODES.items() if mode in modes)
        section["velocity_mode"] = velocity.value
    if axis.counts_per_turn is not None:
        section["counts_per_rad"] = axis.counts_per_turn / (2.0 * math.pi)
    return section


def module_section(node: int, identity: tuple[int, ...], module: FoundModule) -> dict[str, Any]:
    """Return one item of ``backends.canopen.io``."""
    return {
        "node": node,
        "identity": _identity(identity),
        "input_length": min(module.inputs, 8),
        "output_length": min(module.outputs, 8),
    }


def sync_period_s(axes: int, bitrate: int) -> float:
    """Return the shortest SYNC period in which a bus carries ``axes``."""
    cycles = math.ceil(axes * AXIS_BITS / bitrate / BUS_LOAD / CYCLE_S)
    return round(max(cycles, 1) * CYCLE_S, 6)


def _axes(read: Read) -> Iterator[FoundAxis]:
    for offset in range(MAX_AXES):
        step = offset * AXIS_STEP
        supported = _number(read, 0x6502 + step, 0)
        if not supported and offset:
            return
        modes = tuple(mode for mode in OperationMode if mode and supported & mode.support_bit)
        yield FoundAxis(offset, modes, _counts_per_turn(read, step))


def _counts_per_turn(read: Read, step: int) -> float | None:
    """Return increments / motor turn · motor turns / shaft turn (CiA 402-2, 0x608F, 0x6091)."""
    increments, turns = (_number(read, 0x608F + step, sub) for sub in (1, 2))
    if not increments or not turns:
        return None
    motor, shaft = (_number(read, 0x6091 + step, sub) or 1 for sub in (1, 2))
    return increments / turns * motor / shaft


def _identity(identity: tuple[int, ...]) -> dict[str, int]:
    """Return vendor and product; a spare part has another serial number."""
    return {"vendor_id": identity[0], "product_code": identity[1]}


def _number(read: Read, index: int, sub: int) -> int:
    try:
        return read(index, sub)
    except RobotdError:
        return 0
