"""Scan of a fieldbus: nodes that answer, and axes as their drives describe them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from robotd.api import RobotdError
from robotd_cia402.modes import OperationMode
from robotd_cia402.node import IDENTITY
from robotd_cia402.object_numbers import AXIS_STEP

DRIVE, MODULE = 402, 401  # device profiles, the low half of object 0x1000
MAX_AXES = 8  # of one drive
SAME_SCALE_SHARE = 1e-6  # part; scales that differ by less are the same

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
        if max(self.scales.values()) > (1.0 + SAME_SCALE_SHARE) * min(self.scales.values()):
            stated = ", ".join(f"{scale:.10g} ({name})" for name, scale in self.scales.items())
            keys["remark"] = f"scale in doubt, the drive states for a turn {stated}: measure it"
        return keys


@dataclass(frozen=True, kw_only=True)
class FoundNode:
    """One node that answered.

    Attributes:
        number: node id, or place on the cable.
        identity: vendor, product, revision, serial.
        state: of communication, in words.
        profile: number of its device profile; 0 for none.
        axes: of a drive.
        sizes: bytes of outputs and inputs of an I/O module.
    """

    kind: ClassVar[str] = "node"

    number: int
    name: str
    identity: tuple[int, ...]
    state: str
    profile: int = 0
    axes: tuple[FoundAxis, ...] = ()
    sizes: tuple[int, int] = (0, 0)

    @property
    def is_drive(self) -> bool:
        return self.profile == DRIVE

    @property
    def more(self) -> dict[str, Any]:
        """Further keys of the node, which an axis does not have."""
        return {}

    @property
    def remark(self) -> str:
        """Text behind the name in the list of the nodes."""
        return ""

    def mode_keys(self, axis: FoundAxis) -> dict[str, Any]:
        """Return the keys of an axis that follow from its modes."""
        return {}

    def section(self, **keys: Any) -> dict[str, Any]:
        """Return the keys of one item of ``axes`` or ``io``."""
        # Vendor and product alone: a spare part has another serial number.
        identity = dict(zip(IDENTITY[:2], self.identity, strict=False))
        return {self.kind: self.number, "identity": identity, **keys}

    def axis_section(self, axis: FoundAxis) -> dict[str, Any]:
        """Return the keys of one item of ``axes`` that the scan knows."""
        offset = {"axis_offset": axis.offset} if axis.offset else {}
        return self.section(**offset, **self.mode_keys(axis), **axis.scale_keys)

    def __str__(self) -> str:
        profile = f"CiA {self.profile}, " if self.profile else ""
        vendor, product, revision, serial = self.identity
        modes = " ".join(mode.name.lower() for axis in self.axes[:1] for mode in axis.modes)
        alias = f"alias {self.more['alias']}, " if self.more.get("alias") else ""
        return (
            f"{self.kind} {self.number:3}: {profile}{alias}vendor 0x{vendor:08X},"
            f" product 0x{product:08X}, revision 0x{revision:08X}, serial {serial},"
            f" {self.state}, {self.name!r}{self.remark}{f'; {modes}' if modes else ''}"
        )


def scan_sections(
    backend: str, nodes: Sequence[FoundNode], options: Mapping[str, Any], max_io_bytes: int
) -> dict[str, Any]:
    """Return a scan in the form that ``robotd new-robot --bus`` reads."""
    modules = [node for node in nodes if not node.is_drive and any(node.sizes)]
    kind = nodes[0].kind if nodes else "node"
    return {
        "backend": backend,
        "scale": "counts_per_rad",
        "options": dict(options),
        "axes": [node.axis_section(axis) for node in nodes for axis in node.axes],
        "io": [
            node.section(
                input_length=min(node.sizes[1], max_io_bytes),
                output_length=min(node.sizes[0], max_io_bytes),
            )
            for node in modules
        ],
        f"{kind}s": [
            {
                kind: node.number,
                "name": node.name,
                "profile": node.profile,
                **dict(zip(IDENTITY, node.identity, strict=True)),
                **node.more,
                "state": node.state,
                "modes": [[mode.name.lower() for mode in axis.modes] for axis in node.axes],
            }
            for node in nodes
        ],
    }


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
