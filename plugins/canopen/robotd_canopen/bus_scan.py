"""Scan of a bus without a descriptor, and access to single objects."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from robotd.api import InvalidArgument, RobotdError
from robotd_canopen.bus import Bus
from robotd_canopen.node import NmtState, heartbeat_state
from robotd_canopen.object_dictionary import empty_dictionary
from robotd_canopen.options import BusOptions
from robotd_canopen.sdo import Sdo
from robotd_cia402 import drive_scan
from robotd_cia402.drive_scan import DRIVE, MODULE, FoundAxis, read_axes, read_or_zero
from robotd_cia402.modes import STREAM_MODES, VELOCITY_MODES

_LAST_NODE = 127
_READ_DEVICE_TYPE = bytes([0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0])
_AXIS_BITS = 530  # on the wire for each SYNC, with the default PDOs
_BUS_LOAD = 0.85  # leaves a margin below ``max_bus_load``
_CYCLE_S = 0.002  # of a robot with the default rate; a SYNC takes a whole number of them
_MAX_IO_BYTES = 8  # of a module, in each direction


@dataclass(frozen=True, kw_only=True)
class FoundNode(drive_scan.FoundNode):
    """One node that answered.

    Attributes:
        duplicate: one SDO request had several responses: several nodes have this id.
    """

    duplicate: bool = False

    @property
    def more(self) -> dict[str, Any]:
        return {"duplicate": self.duplicate}

    @property
    def remark(self) -> str:
        return ", DUPLICATE ID: several responses to one request" if self.duplicate else ""

    def mode_keys(self, axis: FoundAxis) -> dict[str, Any]:
        stream = next((key for key, mode in STREAM_MODES.items() if mode in axis.modes), None)
        velocity = next((key for key, mode in VELOCITY_MODES.items() if mode in axis.modes), None)
        keys = {"stream_mode": stream, "velocity_mode": velocity}
        return {key: value.value for key, value in keys.items() if value is not None}


def scan(options: Mapping[str, str]) -> Mapping[str, Any]:
    """Return what is on the bus of ``channel``, for ``robotd new-robot --bus``.

    Args:
        options: ``channel`` (or ``address``), and as far as they differ from the command's:
            ``interface``, ``bitrate`` in bit/s and ``timeout_s``.

    Raises InvalidArgument: no channel, or no number. RobotdError: the bus does not open.
    """
    interface = options.get("interface", "socketcan")
    channel = options.get("channel") or options.get("address", "")
    if not channel:
        raise InvalidArgument("name the channel of the CAN bus, for example channel=can0")
    try:
        bitrate = int(options.get("bitrate", "1000000"))
        timeout_s = float(options.get("timeout_s", "0.5"))
    except ValueError as error:
        raise InvalidArgument(f"bitrate or timeout_s: {error}") from error
    found = scan_bus(interface, channel, bitrate, timeout_s)
    return scan_sections(found, interface, channel, bitrate)


def scan_bus(interface: str, channel: str, bitrate: int, timeout_s: float = 0.5) -> list[FoundNode]:
    """Read the device type of every node id, and the identity of those that answer."""
    bus = Bus(_bus_options(interface, channel, bitrate))
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
        counts = dict(answers)
        found = [_ask(bus, node, timeout_s) for node in sorted(counts)]
    finally:
        bus.close()
    return [
        FoundNode(
            **one, state=_state(states.get(one["number"])), duplicate=counts[one["number"]] > 1
        )
        for one in found
    ]


def scan_sections(
    nodes: Sequence[FoundNode], interface: str, channel: str, bitrate: int
) -> dict[str, Any]:
    """Return the scan in the form that ``robotd new-robot --bus`` reads."""
    bus = _bus_options(interface, channel, bitrate)
    # The shortest SYNC period in which the bus carries the axes.
    axes = sum(len(node.axes) for node in nodes)
    cycles = math.ceil(axes * _AXIS_BITS / bitrate / _BUS_LOAD / _CYCLE_S)
    options = {
        "bus": bus.model_dump(exclude_defaults=True) | {"bitrate": bitrate},
        "sync_period_s": round(max(cycles, 1) * _CYCLE_S, 6),
    }
    return drive_scan.scan_sections("canopen", nodes, options, _MAX_IO_BYTES)


@contextmanager
def sdo_of(
    interface: str, channel: str, bitrate: int, node: int, timeout_s: float = 0.3
) -> Iterator[Sdo]:
    """Yield an SDO client of one node on a bus of its own. Raises ConnectError."""
    bus = Bus(_bus_options(interface, channel, bitrate))
    bus.open()
    try:
        yield Sdo(bus, node, f"node {node}", empty_dictionary(), timeout_s)
    finally:
        bus.close()


def _bus_options(interface: str, channel: str, bitrate: int) -> BusOptions:
    name, _, port = channel.partition("#")
    options = {"port": int(port)} if port else {}
    return BusOptions(interface=interface, channel=name, bitrate=bitrate, options=options)


def _state(state: NmtState | None) -> str:
    return "no heartbeat" if state is None else state.name.lower()


def _ask(bus: Bus, node: int, timeout_s: float) -> dict[str, Any]:
    """Ask a node for what it is; return fields of ``FoundNode``."""
    sdo = Sdo(bus, node, f"node {node}", empty_dictionary(), timeout_s, tries=2)

    def read(index: int, sub: int) -> int:
        return int.from_bytes(sdo.upload(index, sub), "little")

    try:
        name = sdo.upload(0x1008, 0).decode("ascii", "replace")
    except RobotdError:
        name = ""
    profile = read_or_zero(read, 0x1000, 0) & 0xFFFF
    return {
        "number": node,
        "name": name,
        "identity": tuple(read_or_zero(read, 0x1018, sub) for sub in range(1, 5)),
        "profile": profile,
        "axes": read_axes(read) if profile == DRIVE else (),
        "sizes": module_sizes(read) if profile == MODULE else (0, 0),
    }


def module_sizes(read: drive_scan.Read) -> tuple[int, int]:
    """Ask a CiA 401 node for its bytes of outputs and inputs."""
    return read_or_zero(read, 0x6200, 0), read_or_zero(read, 0x6000, 0)
