"""Scan of a bus without a descriptor, and access to single objects."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from robotd.api import RobotdError
from robotd_canopen.bus import Bus
from robotd_canopen.nmt import NmtState, heartbeat_state
from robotd_canopen.object_dictionary import empty_dictionary
from robotd_canopen.options import BusOptions
from robotd_canopen.scan_report import (
    DRIVE,
    MODULE,
    FoundModule,
    axis_section,
    module_section,
    read_module,
    sync_period_s,
)
from robotd_canopen.sdo import Sdo
from robotd_cia402.drive_scan import FoundAxis, read_axes

_LAST_NODE = 127
_DUPLICATE = ", DUPLICATE ID: several responses to one request"
_READ_DEVICE_TYPE = bytes([0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0])


@dataclass(frozen=True)
class FoundNode:
    """One node that answered.

    Attributes:
        identity: vendor, product, revision, serial.
        axes: of a CiA 402 drive.
        module: size of a CiA 401 module.
        duplicate: one SDO request had several responses: several nodes have this id.
    """

    id: int
    device_type: int
    identity: tuple[int, ...]
    name: str
    state: NmtState
    duplicate: bool = False
    axes: tuple[FoundAxis, ...] = ()
    module: FoundModule | None = None

    @property
    def profile(self) -> int:
        """Number of the CiA device profile; 0 for none."""
        return self.device_type & 0xFFFF

    def __str__(self) -> str:
        vendor, product, revision, serial = self.identity
        state = "no heartbeat" if self.state is NmtState.UNKNOWN else self.state.name.lower()
        modes = " ".join(mode.name.lower() for axis in self.axes[:1] for mode in axis.modes)
        return (
            f"node {self.id:3}: CiA {self.profile}, vendor 0x{vendor:08X},"
            f" product 0x{product:08X}, revision 0x{revision:08X}, serial {serial},"
            f" {state}, {self.name!r}{_DUPLICATE if self.duplicate else ''}"
            f"{f'; {modes}' if modes else ''}"
        )


def scan_bus(interface: str, channel: str, bitrate: int, timeout_s: float = 0.5) -> list[FoundNode]:
    """Read the device type of every node id, and the identity of those that answer."""
    bus = _bus(interface, channel, bitrate)
    states: dict[int, NmtState] = {}
    answers: Counter[int] = Counter()

    def on_answer(node: int, data: bytearray) -> None:
        answers[node] += 1

    def on_heartbeat(node: int, data: bytearray) -> None:
        states[node] = heartbeat_state(data)

    for node in range(1, _LAST_NODE + 1):
        bus.subscribe(0x580 + node, partial(on_answer, node))
        bus.subscribe(0x700 + node, partial(on_heartbeat, node))
    bus.open()
    try:
        for node in range(1, _LAST_NODE + 1):
            bus.send_message(0x600 + node, _READ_DEVICE_TYPE)
        time.sleep(timeout_s)
        duplicate = {node for node, count in answers.items() if count > 1}
        found = [_ask(bus, node, timeout_s) for node in sorted(answers)]
    finally:
        bus.close()
    return [
        replace(node, state=states.get(node.id, NmtState.UNKNOWN), duplicate=node.id in duplicate)
        for node in found
    ]


def scan_sections(
    nodes: Sequence[FoundNode], interface: str, channel: str, bitrate: int
) -> dict[str, Any]:
    """Return the scan in the form that ``robotd new-robot --bus`` reads."""
    bus = _bus_options(interface, channel, bitrate)
    return {
        "backend": "canopen",
        "scale": "counts_per_rad",
        "options": {
            "bus": bus.model_dump(exclude_defaults=True) | {"bitrate": bitrate},
            "sync_period_s": sync_period_s(sum(len(node.axes) for node in nodes), bitrate),
        },
        "axes": [
            axis_section(node.id, node.identity, axis) for node in nodes for axis in node.axes
        ],
        "io": [
            module_section(node.id, node.identity, node.module)
            for node in nodes
            if node.module is not None
        ],
        "nodes": [
            {
                "node": node.id,
                "profile": node.profile,
                "name": node.name,
                "vendor_id": node.identity[0],
                "product_code": node.identity[1],
                "revision": node.identity[2],
                "serial": node.identity[3],
                "state": node.state.name.lower(),
                "duplicate": node.duplicate,
                "modes": [[mode.name.lower() for mode in axis.modes] for axis in node.axes],
            }
            for node in nodes
        ],
    }


@contextmanager
def sdo_of(
    interface: str, channel: str, bitrate: int, node: int, timeout_s: float = 0.3
) -> Iterator[Sdo]:
    """Yield an SDO client of one node on a bus of its own. Raises ConnectError."""
    bus = _bus(interface, channel, bitrate)
    bus.open()
    try:
        yield Sdo(bus, node, f"node {node}", empty_dictionary(), timeout_s)
    finally:
        bus.close()


def _bus(interface: str, channel: str, bitrate: int) -> Bus:
    return Bus(_bus_options(interface, channel, bitrate))


def _bus_options(interface: str, channel: str, bitrate: int) -> BusOptions:
    name, _, port = channel.partition("#")
    options = {"port": int(port)} if port else {}
    return BusOptions(interface=interface, channel=name, bitrate=bitrate, options=options)


def _ask(bus: Bus, node: int, timeout_s: float) -> FoundNode:
    sdo = Sdo(bus, node, f"node {node}", empty_dictionary(), timeout_s, tries=2)

    def read(index: int, sub: int) -> int:
        return int.from_bytes(sdo.upload(index, sub), "little")

    def number(index: int, sub: int) -> int:
        try:
            return read(index, sub)
        except RobotdError:
            return 0

    try:
        name = sdo.upload(0x1008, 0).decode("ascii", "replace")
    except RobotdError:
        name = ""
    kind = number(0x1000, 0)
    identity = tuple(number(0x1018, sub) for sub in range(1, 5))
    found = FoundNode(node, kind, identity, name, NmtState.UNKNOWN)
    return replace(
        found,
        axes=read_axes(read) if found.profile == DRIVE else (),
        module=read_module(read) if found.profile == MODULE else None,
    )
