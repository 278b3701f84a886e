"""Scan of a bus without a descriptor, and access to single slaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from robotd.api import MonotonicClock, OperationError, RobotdError, wait_until
from robotd_cia402.modes import OperationMode
from robotd_ethercat.al_status import AlState, al_code_text
from robotd_ethercat.mapping import Assignment, Pdo, read_mapping, size_bytes
from robotd_ethercat.soem import Soem

_DRIVE = 402  # device profile, the low half of object 0x1000
_STATE_S = 3.0
_SDO_S, _FRAME_S = 0.7, 0.05
_MAX_AXES, _AXIS_STEP = 8, 0x800


class SlaveAccess:
    """SDO transfers with one scanned slave, in state PreOp."""

    def __init__(self, bus: Soem, slave: int) -> None:
        self._bus, self._slave = bus, slave

    def upload(self, index: int, sub: int = 0) -> bytes:
        return self._bus.upload(self._slave, index, sub)

    def download(self, index: int, sub: int, data: bytes) -> None:
        self._bus.download(self._slave, index, sub, data)

    def number(self, index: int, sub: int = 0) -> int:
        """Return an object as an unsigned number; 0 where there is none."""
        try:
            return int.from_bytes(self.upload(index, sub), "little")
        except RobotdError:
            return 0


@dataclass(frozen=True)
class FoundSlave:
    """One slave on the bus.

    Attributes:
        number: place on the cable, from 0.
        identity: vendor, product, revision, serial.
        state: AL state and code in words; "PreOp" where all is well.
        profile: of object 0x1000, 0 without a mailbox.
        modes: supported modes of operation of each axis of a drive.
        counts_per_turn: encoder counts of one turn behind the gear, per axis; None: not stated.
        sizes: bytes of outputs and inputs, by the PDOs that are assigned now.
    """

    number: int
    name: str
    identity: tuple[int, int, int, int]
    alias: int
    state: str
    profile: int = 0
    modes: tuple[tuple[OperationMode, ...], ...] = ()
    counts_per_turn: tuple[float | None, ...] = ()
    sizes: tuple[int, int] = (0, 0)

    @property
    def is_drive(self) -> bool:
        return self.profile == _DRIVE

    def __str__(self) -> str:
        vendor, product, revision, serial = self.identity
        kind = f"CiA {self.profile}, " if self.profile else ""
        modes = " ".join(mode.name.lower() for mode in self.modes[0]) if self.modes else ""
        alias = f"alias {self.alias}, " if self.alias else ""
        return (
            f"slave {self.number:3}: {kind}{alias}vendor 0x{vendor:08X}, product 0x{product:08X},"
            f" revision 0x{revision:08X}, serial {serial}, {self.state}, {self.name!r},"
            f" {self.sizes[0]} bytes out, {self.sizes[1]} in{f'; {modes}' if modes else ''}"
        )


@contextmanager
def open_bus(interface: str, bus: Soem | None = None) -> Iterator[Soem]:
    """Yield a bus whose slaves are in PreOp, as far as they get there. Raises ConnectError."""
    opened = bus or Soem(_SDO_S)
    opened.open(interface, None)
    opened.set_frame_timeout(_FRAME_S)
    try:
        if opened.find_slaves():
            opened.request(AlState.PRE_OP, acknowledge=True)
            wait_until(lambda: _settled(opened), _STATE_S, MonotonicClock())
        yield opened
    finally:
        opened.close()


def scan_bus(bus: Soem) -> list[FoundSlave]:
    """Read identity, state, modes and sizes of every slave."""
    states = bus.states()
    return [_ask(bus, number, states[number]) for number in range(len(bus.slaves))]


def slave_of(bus: Soem, slave: int) -> SlaveAccess:
    """Return the access to one slave. Raises OperationError if there is none."""
    if slave >= len(bus.slaves):
        count = len(bus.slaves)
        found = f"it has {count} slaves, 0 to {count - 1}" if count else "no slave answers"
        raise OperationError(f"slave {slave} is not on the bus: {found}")
    return SlaveAccess(bus, slave)


def pdos_of(access: SlaveAccess) -> dict[Assignment, list[Pdo]]:
    """Read both assignments with their contents. Raises OperationError, DeviceTimeout."""
    return {assignment: read_mapping(access, assignment) for assignment in Assignment}


def scan_sections(slaves: Sequence[FoundSlave], interface: str) -> dict[str, Any]:
    """Return the scan in the form that ``robotd new-robot --bus`` reads."""
    return {
        "backend": "ethercat",
        "scale": "counts_per_rad",
        "options": {"interface": interface},
        "axes": [
            _axis_section(slave, offset)
            for slave in slaves
            if slave.is_drive
            for offset in range(len(slave.modes))
        ],
        "io": [
            {
                "slave": slave.number,
                "identity": _identity(slave),
                "input_length": slave.sizes[1],
                "output_length": slave.sizes[0],
            }
            for slave in slaves
            if not slave.is_drive and any(slave.sizes)
        ],
        "slaves": [
            {
                "slave": slave.number,
                "name": slave.name,
                "profile": slave.profile,
                "vendor_id": slave.identity[0],
                "product_code": slave.identity[1],
                "revision": slave.identity[2],
                "serial": slave.identity[3],
                "alias": slave.alias,
                "state": slave.state,
                "modes": [[mode.name.lower() for mode in axis] for axis in slave.modes],
            }
            for slave in slaves
        ],
    }


def _settled(bus: Soem) -> bool:
    return all(found.state is AlState.PRE_OP or found.error for found in bus.states())


def _ask(bus: Soem, number: int, found: Any) -> FoundSlave:
    access = SlaveAccess(bus, number)
    text = al_code_text(found.code) if found.error else ""
    profile = access.number(0x1000) & 0xFFFF
    modes = tuple(_modes(access)) if profile == _DRIVE else ()
    return FoundSlave(
        number=number,
        name=bus.slaves[number].name,
        identity=bus.identity(number),
        alias=int.from_bytes(bus.read_register(number, 0x0012, 2), "little"),
        state=found.state.text + (f" ({text})" if text else ""),
        profile=profile,
        modes=modes,
        counts_per_turn=tuple(
            _counts_per_turn(access.number, axis * _AXIS_STEP) for axis in range(len(modes))
        ),
        sizes=_sizes(bus, access, number),
    )


def _modes(access: SlaveAccess) -> Iterator[tuple[OperationMode, ...]]:
    for offset in range(_MAX_AXES):
        supported = access.number(0x6502 + offset * _AXIS_STEP)
        if not supported and offset:
            return
        yield tuple(mode for mode in OperationMode if mode and supported & mode.support_bit)


def _counts_per_turn(number: Callable[[int, int], int], step: int) -> float | None:
    """Return increments / motor turn · motor turns / shaft turn (CiA 402-2, 0x608F, 0x6091)."""
    increments, turns = (number(0x608F + step, sub) for sub in (1, 2))
    if not increments or not turns:
        return None
    motor, shaft = (number(0x6091 + step, sub) or 1 for sub in (1, 2))
    return increments / turns * motor / shaft


def _sizes(bus: Soem, access: SlaveAccess, number: int) -> tuple[int, int]:
    """Bytes by CoE; of a slave without a mailbox by the sync managers in its SII."""
    try:
        pdos = pdos_of(access)
    except RobotdError:
        from robotd_ethercat.sii import process_data_sizes

        return process_data_sizes(lambda word: bus.read_sii(number, word))
    return size_bytes(pdos[Assignment.OUTPUTS]), size_bytes(pdos[Assignment.INPUTS])


def _axis_section(slave: FoundSlave, offset: int) -> dict[str, Any]:
    section: dict[str, Any] = {"slave": slave.number, "identity": _identity(slave)}
    if offset:
        section["axis_offset"] = offset
    if slave.alias:
        section["alias"] = slave.alias
    modes = slave.modes[offset]
    if OperationMode.CYCLIC_VELOCITY not in modes and OperationMode.PROFILE_VELOCITY in modes:
        section["velocity_mode"] = "pv"
    counts = slave.counts_per_turn[offset]
    if counts is not None:
        section["counts_per_rad"] = counts / (2.0 * math.pi)
    return section


def _identity(slave: FoundSlave) -> dict[str, int]:
    """Return vendor and product; a spare part has another serial number."""
    return {"vendor_id": slave.identity[0], "product_code": slave.identity[1]}
