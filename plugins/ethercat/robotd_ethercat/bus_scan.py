"""Scan of a bus without a descriptor, and access to single slaves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from robotd.api import InvalidArgument, MonotonicClock, OperationError, RobotdError, wait_until
from robotd_cia402 import drive_scan
from robotd_cia402.drive_scan import DRIVE, FoundAxis, FoundNode, read_axes, read_or_zero
from robotd_cia402.modes import OperationMode
from robotd_ethercat.al_status import AlState, al_code_text
from robotd_ethercat.esi_choice import clock_keys, pdo_keys, with_remark
from robotd_ethercat.esi_device import EsiDevice
from robotd_ethercat.esi_reader import EsiLibrary
from robotd_ethercat.mapping import Assignment, Pdo, read_mapping, size_bytes
from robotd_ethercat.options import MAX_IO_BYTES
from robotd_ethercat.soem import Soem

_STATE_S = 3.0
_SDO_S, _FRAME_S = 0.7, 0.05
# Process data in the SII EEPROM of a slave (ETG.1000.6, table 18; ETG.2010).
_FIRST_CATEGORY = 0x40  # word address
_TX_PDO, _RX_PDO, _END = 50, 51, 0xFFFF
_MAX_WORDS = 0x2000
_HEADER_BYTES, _ENTRY_BYTES = 8, 8
_BITS, _SYNC_MANAGER, _ENTRIES, _UNUSED = 5, 3, 2, 0xFF

ReadWords = Callable[[int], int]
"""Reads 32 bits at a word address."""


class SlaveAccess:
    """SDO transfers with one scanned slave, in state PreOp."""

    def __init__(self, bus: Soem, slave: int) -> None:
        self._bus, self._slave = bus, slave

    def upload(self, index: int, sub: int = 0) -> bytes:
        return self._bus.upload(self._slave, index, sub)

    def download(self, index: int, sub: int, data: bytes) -> None:
        self._bus.download(self._slave, index, sub, data, retry=False)

    def identity(self) -> tuple[int, int, int, int]:
        """Return vendor, product, revision and serial of the SII."""
        return self._bus.identity(self._slave)

    def unsigned(self, index: int, sub: int = 0) -> int:
        """Return an object as an unsigned number. Raises OperationError, DeviceTimeout."""
        return int.from_bytes(self.upload(index, sub), "little")


@dataclass(frozen=True, kw_only=True)
class FoundSlave(FoundNode):
    """One slave on the bus.

    Attributes:
        alias: station alias; 0 for none.
        state: AL state and code in words; "PreOp" where all is well.
        sizes: by the PDOs that are assigned now.
        esi: what an ESI says of it; None where there is none.
    """

    kind: ClassVar[str] = "slave"

    alias: int = 0
    esi: EsiDevice | None = None

    @property
    def more(self) -> dict[str, Any]:
        return {"alias": self.alias}

    def device(self, library: EsiLibrary | None) -> EsiDevice | None:
        """Return what an ESI says of it; None where there is none."""
        return library.find(*self.identity[:3]) if library is not None else None

    @property
    def remark(self) -> str:
        return f", {self.sizes[0]} bytes out, {self.sizes[1]} in"

    def mode_keys(self, axis: FoundAxis) -> dict[str, Any]:
        modes = axis.modes
        keys: dict[str, Any] = {"alias": self.alias} if self.alias else {}
        if OperationMode.CYCLIC_VELOCITY not in modes and OperationMode.PROFILE_VELOCITY in modes:
            keys["velocity_mode"] = "pv"
        return keys

    def axis_section(self, axis: FoundAxis) -> dict[str, Any]:
        section = super().axis_section(axis)
        if self.esi is None:
            return section
        own = pdo_keys(self.esi, pv="velocity_mode" in section).get(axis.offset, {})
        remark = own.pop("remark", "")
        return with_remark(section | own, remark) if remark else section | own


def scan(options: Mapping[str, str]) -> Mapping[str, Any]:
    """Return what is on the bus of ``interface``, for ``robotd new-robot --bus``.

    Args:
        options: ``interface`` (or ``address``), and ``esi`` for a folder or file of descriptions.

    Raises InvalidArgument: no interface. RobotdError: the bus does not open.
    """
    interface, esi = options.get("interface") or options.get("address"), options.get("esi")
    if not interface:
        raise InvalidArgument("name the network interface, for example interface=eth1")
    with open_bus(interface) as bus:
        found = scan_bus(bus)
    return scan_sections(found, interface, read_library(Path(esi), found) if esi else None)


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


@contextmanager
def open_slave(interface: str, slave: int) -> Iterator[SlaveAccess]:
    """Yield the access to one slave. Raises ConnectError, OperationError if there is none."""
    with open_bus(interface) as bus:
        if slave >= (count := len(bus.slaves)):
            found = f"it has {count} slaves, 0 to {count - 1}" if count else "no slave answers"
            raise OperationError(f"slave {slave} is not on the bus: {found}")
        yield SlaveAccess(bus, slave)


def pdos_of(access: SlaveAccess) -> dict[Assignment, list[Pdo]]:
    """Read both assignments with their contents. Raises OperationError, DeviceTimeout."""
    return {assignment: read_mapping(access, assignment) for assignment in Assignment}


def read_library(path: Path, slaves: Sequence[FoundSlave]) -> EsiLibrary:
    """Read the ESI files of ``path`` for the slaves. Raises DescriptorError: no such path."""
    return EsiLibrary(path, {(slave.identity[0], slave.identity[1]) for slave in slaves})


def scan_sections(
    slaves: Sequence[FoundSlave], interface: str, library: EsiLibrary | None = None
) -> dict[str, Any]:
    """Return the scan in the form that ``robotd new-robot --bus`` reads.

    With ``library`` the drives have the PDOs and clocks that their ESI files offer.
    """
    found = [replace(slave, esi=slave.device(library)) for slave in slaves]
    drives = [slave.esi for slave in found if slave.is_drive]
    clocks = clock_keys([one for one in drives if one]) if all(drives) else {}
    options = {"interface": interface, **clocks}
    return drive_scan.scan_sections("ethercat", found, options, MAX_IO_BYTES)


def _settled(bus: Soem) -> bool:
    return all(found.state is AlState.PRE_OP or found.error for found in bus.states())


def _ask(bus: Soem, number: int, found: Any) -> FoundSlave:
    access = SlaveAccess(bus, number)
    text = al_code_text(found.code) if found.error else ""
    profile = read_or_zero(access.unsigned, 0x1000, 0) & 0xFFFF
    axes = read_axes(access.unsigned) if profile == DRIVE else ()
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
        return process_data_sizes(lambda word: bus.read_sii(number, word))
    return size_bytes(pdos[Assignment.OUTPUTS]), size_bytes(pdos[Assignment.INPUTS])


def process_data_sizes(read: ReadWords) -> tuple[int, int]:
    """Return the bytes of outputs and inputs of the PDOs that are assigned by default."""
    bits = {_RX_PDO: 0, _TX_PDO: 0}
    for kind, data in _categories(read):
        if kind in bits:
            bits[kind] += _assigned_bits(data)
    return (bits[_RX_PDO] + 7) // 8, (bits[_TX_PDO] + 7) // 8


def _categories(read: ReadWords) -> Iterator[tuple[int, bytes]]:
    """Yield type and contents of the PDO categories."""
    word = _FIRST_CATEGORY
    while word < _MAX_WORDS:
        header = read(word)
        kind, words = header & 0xFFFF, header >> 16
        if kind == _END:
            return
        if kind in (_TX_PDO, _RX_PDO):
            yield (
                kind,
                b"".join(
                    read(word + 2 + offset).to_bytes(4, "little") for offset in range(0, words, 2)
                )[: 2 * words],
            )
        word += 2 + words


def _assigned_bits(data: bytes) -> int:
    """Sum the entries of the PDOs in one category that have a sync manager."""
    bits = position = 0
    while position + _HEADER_BYTES <= len(data):
        entries, assigned = data[position + _ENTRIES], data[position + _SYNC_MANAGER] != _UNUSED
        first = position + _HEADER_BYTES
        position = first + entries * _ENTRY_BYTES
        if assigned:
            bits += sum(data[first + _BITS : position : _ENTRY_BYTES])
    return bits
