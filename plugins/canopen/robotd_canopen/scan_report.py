"""Scanned drives and modules as sections of a robot, for ``robotd new-robot --bus``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from robotd_cia402.drive_scan import FoundAxis, Read, read_or_zero
from robotd_cia402.modes import STREAM_MODES, VELOCITY_MODES

DRIVE, MODULE = 402, 401  # device profiles, the low half of object 0x1000
AXIS_BITS = 530  # on the wire for each SYNC, with the default PDOs
BUS_LOAD = 0.85  # leaves a margin below ``max_bus_load``
CYCLE_S = 0.002  # of a robot with the default rate; a SYNC takes a whole number of them


@dataclass(frozen=True)
class FoundModule:
    """Size of an I/O module in bytes."""

    inputs: int
    outputs: int


def read_module(read: Read) -> FoundModule:
    """Ask a CiA 401 node for its size."""
    return FoundModule(read_or_zero(read, 0x6000, 0), read_or_zero(read, 0x6200, 0))


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
    return section | axis.scale_keys


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


def _identity(identity: tuple[int, ...]) -> dict[str, int]:
    """Return vendor and product; a spare part has another serial number."""
    return {"vendor_id": identity[0], "product_code": identity[1]}
