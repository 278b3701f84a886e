"""Scan of a bus without a descriptor, and access to single objects."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from robotd.api import RobotdError
from robotd_canopen.bus import Bus
from robotd_canopen.nmt import NmtState, heartbeat_state
from robotd_canopen.object_dictionary import empty_dictionary
from robotd_canopen.options import BusOptions
from robotd_canopen.sdo import Sdo

_LAST_NODE = 127
_DUPLICATE = ", DUPLICATE ID: several responses to one request"
_READ_DEVICE_TYPE = bytes([0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0])


@dataclass(frozen=True)
class FoundNode:
    """One node that answered.

    Attributes:
        identity: vendor, product, revision, serial.
        duplicate: one SDO request had several responses: several nodes have this id.
    """

    id: int
    device_type: int
    identity: tuple[int, ...]
    name: str
    state: NmtState
    duplicate: bool = False

    def __str__(self) -> str:
        vendor, product, revision, serial = self.identity
        state = "no heartbeat" if self.state is NmtState.UNKNOWN else self.state.name.lower()
        return (
            f"node {self.id:3}: CiA {self.device_type & 0xFFFF}, vendor 0x{vendor:08X},"
            f" product 0x{product:08X}, revision 0x{revision:08X}, serial {serial},"
            f" {state}, {self.name!r}{_DUPLICATE if self.duplicate else ''}"
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
        FoundNode(node, kind, identity, name, states.get(node, NmtState.UNKNOWN), node in duplicate)
        for node, kind, identity, name in found
    ]


@contextmanager
def sdo_of(interface: str, channel: str, bitrate: int, node: int) -> Iterator[Sdo]:
    """Yield an SDO client of one node on a bus of its own. Raises ConnectError."""
    bus = _bus(interface, channel, bitrate)
    bus.open()
    try:
        yield Sdo(bus, node, f"node {node}", empty_dictionary())
    finally:
        bus.close()


def describe_value(data: bytes) -> str:
    """Format data as ``37 02 (0x0237, 567)``, with the text where it is printable."""
    parts = [data.hex(" ")]
    if len(data) in (1, 2, 4, 8):
        number = int.from_bytes(data, "little")
        parts.append(f"(0x{number:0{2 * len(data)}X}, {number})")
    text = data.decode("ascii", "replace")
    if text.isprintable() and len(data) > 1:
        parts.append(repr(text))
    return " ".join(parts)


def _bus(interface: str, channel: str, bitrate: int) -> Bus:
    name, _, port = channel.partition("#")
    options = {"port": int(port)} if port else {}
    settings = BusOptions(interface=interface, channel=name, bitrate=bitrate, options=options)
    return Bus(settings)


def _ask(bus: Bus, node: int, timeout_s: float) -> tuple[int, int, tuple[int, ...], str]:
    sdo = Sdo(bus, node, f"node {node}", empty_dictionary(), timeout_s, tries=2)

    def number(index: int, sub: int) -> int:
        try:
            return int.from_bytes(sdo.upload(index, sub), "little")
        except RobotdError:
            return 0

    try:
        name = sdo.upload(0x1008, 0).decode("ascii", "replace")
    except RobotdError:
        name = ""
    return node, number(0x1000, 0), tuple(number(0x1018, sub) for sub in range(1, 5)), name
