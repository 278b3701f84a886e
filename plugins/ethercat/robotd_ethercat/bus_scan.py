"""Scan of a bus without a descriptor, and access to single slaves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robotd.api import MonotonicClock, OperationError, RobotdError, wait_until
from robotd_cia402.drive_scan import FoundAxis, read_axes, read_or_zero
from robotd_cia402.modes import OperationMode
from robotd_ethercat.al_status import AlState, al_code_text
from robotd_ethercat.esi_choice import clock_keys, pdo_keys, with_remark
from robotd_ethercat.esi_device import EsiDevice
from robotd_ethercat.esi_library import EsiLibrary
from robotd_ethercat.mapping import Assignment, Pdo, read_mapping, size_bytes
from robotd_ethercat.soem import Soem

_DRIVE = 402  # device profile, the low half of object 0x1000
_STATE_S = 3.0
_SDO_S, _FRAME_S = 0.7, 0.05


class SlaveAccess:
    """SDO transfers with one scanned slave, in state PreOp."""

    def __init__(self, bus: Soem, slave: int) -> None:
        self._bus, self._slave = bus, slave

    def upload(self, index: int, sub: int = 0) -> bytes:
        return self._bus.upload(self._slave, index, sub)

    def download(self, index: int, sub: int, data: bytes) -> None:
        self._bus.download(self._slave, index, sub, data, retry=False)

    def unsigned(self, index: int, sub: int = 0) -> int:
        """Return an object as an unsigned number. Raises OperationError, DeviceTimeout."""
        return int.from_bytes(self.upload(index, sub), "little")


@dataclass(frozen=True)
class FoundSlave:
    """One slave on the bus.

    Attributes:
        number: place on the cable, from 0.
        identity: vendor, product, revision, serial.
        state: AL state and code in words; "PreOp" where all is well.
        profile: of object 0x1000, 0 without a mailbox.
        axes: of a drive.
        sizes: bytes of outputs and inputs, by the PDOs that are assigned now.
    """

    number: int
    name: str
    identity: tuple[int, int, int, int]
    alias: int
    state: str
    profile: int = 0
    axes: tuple[FoundAxis, ...] = ()
    sizes: tuple[int, int] = (0, 0)

    @property
    def is_drive(self) -> bool:
        return self.profile == _DRIVE

    def device(self, library: EsiLibrary | None) -> EsiDevice | None:
        """Return what an ESI says of it; None where there is none."""
        return library.find(*self.identity[:3]) if library is not None else None

    def __str__(self) -> str:
        vendor, product, revision, serial = self.identity
        kind = f"CiA {self.profile}, " if self.profile else ""
        modes = " ".join(mode.name.lower() for mode in self.axes[0].modes) if self.axes else ""
        alias = f"alias {self.alias}, " if self.alias else ""
        return (
            f"slave {self.number:3}: {kind}{alias}vendor 0x{vendor:08X}, product 0x{product:08X},"
            f" revision 0x{revision:08X}, serial {serial}, {self.state}, {self.name!r},"
            f" {self.sizes[0]} bytes out, {self.sizes[1]} in{f'; {modes}' if modes else ''}"
        )


@contextmanager
def open_bus(interface: str, bus: Soem | None = None) -> Iterator[Soem]:
    """Yield a bus with its slaves in PreOp, where possible. Raises ConnectError."""
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


def read_library(path: Path, slaves: Sequence[FoundSlave]) -> EsiLibrary:
    """Read the ESI files of ``path`` for the slaves. Raises DescriptorError: no such path."""
    return EsiLibrary(path, {slave.identity[:2] for slave in slaves})


def scan_sections(
    slaves: Sequence[FoundSlave], interface: str, library: EsiLibrary | None = None
) -> dict[str, Any]:
    """Return the scan in the form that ``robotd new-robot --bus`` reads.

    With ``library`` the drives have the PDOs and clocks that their ESI files offer.
    """
    found = {slave.number: slave.device(library) for slave in slaves}
    drives = [found[slave.number] for slave in slaves if slave.is_drive]
    clocks = clock_keys([one for one in drives if one]) if all(drives) else {}
    return {
        "backend": "ethercat",
        "scale": "counts_per_rad",
        "options": {"interface": interface, **clocks},
        "axes": [
            _axis_section(slave, axis, found[slave.number])
            for slave in slaves
            for axis in slave.axes
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
                "modes": [[mode.name.lower() for mode in axis.modes] for axis in slave.axes],
            }
            for slave in slaves
        ],
    }


def _settled(bus: Soem) -> bool:
    return all(found.state is AlState.PRE_OP or found.error for found in bus.states())


def _ask(bus: Soem, number: int, found: Any) -> FoundSlave:
    access = SlaveAccess(bus, number)
    text = al_code_text(found.code) if found.error else ""
    profile = read_or_zero(access.unsigned, 0x1000, 0) & 0xFFFF
    axes = read_axes(access.unsigned) if profile == _DRIVE else ()
    return FoundSlave(
        number=number,
        name=bus.slaves[number].name,
        identity=bus.identity(number),
        alias=int.from_bytes(bus.read_register(number, 0x0012, 2), "little"),
        state=found.state.text + (f" ({text})" if text else ""),
        profile=profile,
        axes=axes,
        sizes=_sizes(bus, access, number),
    )


def _sizes(bus: Soem, access: SlaveAccess, number: int) -> tuple[int, int]:
    """Bytes by CoE; without a mailbox by the sync managers in the SII."""
    try:
        pdos = pdos_of(access)
    except RobotdError:
        from robotd_ethercat.sii import process_data_sizes

        return process_data_sizes(lambda word: bus.read_sii(number, word))
    return size_bytes(pdos[Assignment.OUTPUTS]), size_bytes(pdos[Assignment.INPUTS])


def _axis_section(slave: FoundSlave, axis: FoundAxis, esi: EsiDevice | None) -> dict[str, Any]:
    section: dict[str, Any] = {"slave": slave.number, "identity": _identity(slave)}
    if axis.offset:
        section["axis_offset"] = axis.offset
    if slave.alias:
        section["alias"] = slave.alias
    modes = axis.modes
    if OperationMode.CYCLIC_VELOCITY not in modes and OperationMode.PROFILE_VELOCITY in modes:
        section["velocity_mode"] = "pv"
    section |= axis.scale_keys
    own = pdo_keys(esi, pv="velocity_mode" in section).get(axis.offset, {}) if esi else {}
    remark = own.pop("remark", "")
    return with_remark(section | own, remark) if remark else section | own


def _identity(slave: FoundSlave) -> dict[str, int]:
    """Return vendor and product; a spare part has another serial number."""
    return {"vendor_id": slave.identity[0], "product_code": slave.identity[1]}
