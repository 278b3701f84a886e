"""A simulated CANopen node: the library's SDO server and EMCY producer, our NMT and PDOs.

The library's local node answers SDO requests but has no SYNC-driven PDO, no heartbeat consumer
and no boot-up after a reset; these are here.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, cast

import canopen
from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.objectdictionary.datatypes import INTEGER_TYPES, SIGNED_TYPES
from canopen.sdo.exceptions import SdoAbortedError

from robotd_canopen.simulated.simulated_pdo import PdoSet
from robotd_cia402.simulated import DriveFaults

BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
_COMMANDS = {1: OPERATIONAL, 2: STOPPED, 128: PRE_OPERATIONAL}
_RESETS = (129, 130)
_HEARTBEAT_ERROR = 0x8130
_HEARTBEAT_CONSUMER = 0x1016
_COMMUNICATION = 0x10  # bit 4 of the error register

Key = tuple[int, int]
Send = Callable[[int, bytes], None]


@dataclass
class Faults(DriveFaults):
    """Faults in force for one node and its drives; the defaults are a healthy one.

    Attributes:
        silent: sends and receives nothing, as with a broken cable.
        pdo_delay_s: TPDOs are sent this much later; those that wait when it ends are lost.
        pdo_drop: part of the TPDOs that get lost, 0 to 1.
        garbled: part of its frames, PDOs and SDO responses included, replaced by garbage, 0 to 1.
        garbled_frames: frames replaced by garbage so far.
    """

    silent: bool = False
    pdo_delay_s: float = 0.0
    pdo_drop: float = 0.0
    garbled: float = 0.0
    garbled_frames: int = 0
    random: Random = field(default_factory=lambda: Random(1))  # noqa: S311 - repeatable, no secret

    def drops_pdo(self) -> bool:
        """Return True if the TPDO to be sent now is lost."""
        return self.pdo_drop > 0 and self.random.random() < self.pdo_drop

    def garble(self, data: bytes) -> bytes:
        """Return ``data``, or garbage in its place."""
        if self.garbled > 0 and self.random.random() < self.garbled:
            self.garbled_frames += 1
            return self.random.randbytes(self.random.randint(0, 8))
        return data


class SimulatedNode(canopen.LocalNode):
    """One node. Everything is called by the network's thread.

    Attributes:
        number: node id.
        values: every integer object, by index and subindex; PDOs and SDO see the same ones.
        state: NMT state, as in the heartbeat.
        faults: what is wrong with it.
    """

    def __init__(self, node_id: int, eds: Path, identity: dict[int, int] | None = None) -> None:
        super().__init__(node_id, canopen.import_od(str(eds), node_id))
        self.number = node_id
        self._write_callbacks.clear()  # the heartbeat of the library runs in a thread of its own
        self._identity = identity or {}
        self.faults = Faults()
        self.values: dict[Key, int] = {}
        self.state = BOOT_UP
        self.pdos = PdoSet(self.values, _signed(self.object_dictionary))
        self.send: Send = lambda cob_id, data: None
        self._heartbeat_due_ns = 0
        self._master_seen_ns: int | None = None
        self._requested: Key = (0, 0)
        self._restore()

    def connect(self, network: canopen.Network, send: Send) -> None:
        """Join a network; ``send`` takes a COB-ID and data."""
        self.send = send
        network[self.number] = self
        network.unsubscribe(0, self.nmt.on_command)  # ours is called by the network
        network.unsubscribe(self.sdo.rx_cobid, self.sdo.on_request)
        network.subscribe(self.sdo.rx_cobid, self._on_sdo)

    def boot(self, now_ns: int) -> None:
        """Power on or reset: parameters as in the EDS, boot-up message, pre-operational."""
        self._restore()
        self.send(0x700 + self.number, bytes([BOOT_UP]))
        self.state = PRE_OPERATIONAL
        self._heartbeat_due_ns = now_ns
        self._master_seen_ns = None

    def reboot(self) -> None:
        """Reset by itself, as after a dip of its supply."""
        self.boot(time.monotonic_ns())

    def on_nmt(self, data: bytes, now_ns: int) -> None:
        """A frame of the NMT master."""
        code, node = data[0], data[1]
        if node not in (0, self.number) or self.faults.silent:
            return
        if code in _RESETS:
            self.boot(now_ns)
        elif code in _COMMANDS:
            self.state = _COMMANDS[code]
            if self.state == OPERATIONAL:
                self.pdos.configure()
                self.on_operational()

    def on_heartbeat_of(self, node: int, now_ns: int) -> None:
        """Receive a heartbeat: supervision begins with the first (CiA 301, 7.2.8.2.2.2)."""
        if self.values.get((_HEARTBEAT_CONSUMER, 1), 0) >> 16 & 0x7F == node:
            self._master_seen_ns = now_ns

    def tick(self, now_ns: int) -> None:
        """Send the heartbeat, and supervise that of the master."""
        period_ns = self.values.get((0x1017, 0), 0) * 1_000_000
        if period_ns and now_ns >= self._heartbeat_due_ns:
            self._heartbeat_due_ns = now_ns + period_ns
            self.send(0x700 + self.number, bytes([self.state]))
        limit_ns = (self.values.get((_HEARTBEAT_CONSUMER, 1), 0) & 0xFFFF) * 1_000_000
        seen_ns = self._master_seen_ns
        if limit_ns and seen_ns is not None and now_ns - seen_ns > limit_ns:
            self._master_seen_ns = None
            self.emergency(_HEARTBEAT_ERROR, _COMMUNICATION)
            self.on_connection_lost()

    def emergency(self, code: int, register: int | None = None, vendor: bytes = bytes(5)) -> None:
        """Send an EMCY and enter it in objects 0x1001 and 0x1003."""
        register = int(code != 0) if register is None else register
        self.values[0x1001, 0] = register
        if (0x1003, 0) in self.values:
            count = self.values[0x1003, 0] = min(self.values[0x1003, 0] + 1, 8)
            for sub in range(count, 1, -1):
                self.values[0x1003, sub] = self.values[0x1003, sub - 1]
            self.values[0x1003, 1] = code
        self.send(0x80 + self.number, struct.pack("<HB5s", code, register, vendor))

    def before_sync(self, now_ns: int) -> None:
        """A SYNC: synchronous RPDOs that have come since the last one take effect."""
        if self.state == OPERATIONAL and not self.faults.silent:
            self.pdos.apply()

    def after_sync(self) -> None:
        """Sample, and send the TPDOs whose turn it is."""
        if self.state == OPERATIONAL:
            for cob_id, data in (*self.pdos.synchronous(), *self.pdos.changed()):
                self.send(cob_id, data)

    def on_rpdo(self, cob_id: int, data: bytes) -> None:
        """A frame that may be one of the node's RPDOs."""
        if self.state != OPERATIONAL or self.faults.silent:
            return
        short = self.pdos.receive(cob_id, data)
        if short:
            self.emergency(0x8210)
        elif short is False:
            self.on_event()

    def on_operational(self) -> None:
        """NMT start has come."""

    def on_event(self) -> None:
        """An RPDO with an event-driven transmission type has taken effect."""

    def on_connection_lost(self) -> None:
        """Called when the master's heartbeat is missing."""

    def on_written(self, index: int, sub: int) -> None:
        """SDO has written an object."""

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """The library's SDO server reads an object."""
        self._check_fault(index, subindex)
        found: ODVariable = self._find_object(index, subindex)  # type: ignore[no-untyped-call]
        if check_readable and not found.readable:
            raise SdoAbortedError(0x06010001)
        if (index, subindex) in self.values:
            return bytes(found.encode_raw(self.values[index, subindex]))
        return bytes(super().get_data(index, subindex))

    def set_data(
        self, index: int, subindex: int, data: bytes, check_writable: bool = False
    ) -> None:
        """The library's SDO server writes an object."""
        self._check_fault(index, subindex)
        if self._is_mapping(index) and self.state == OPERATIONAL:
            raise SdoAbortedError(0x08000022)
        super().set_data(index, subindex, data, check_writable)
        if index == _HEARTBEAT_CONSUMER:
            self._master_seen_ns = None  # supervision begins anew, with the next heartbeat
        if (index, subindex) in self.values:
            found: ODVariable = self._find_object(index, subindex)  # type: ignore[no-untyped-call]
            self.values[index, subindex] = cast(int, found.decode_raw(bytes(data)))
            self.on_written(index, subindex)

    @staticmethod
    def _is_mapping(index: int) -> bool:
        return 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00

    def _check_fault(self, index: int, sub: int) -> None:
        code = self.faults.abort_code(index, sub)
        if code is not None:
            raise SdoAbortedError(code)

    def _on_sdo(self, cob_id: int, data: bytearray, timestamp: float) -> None:
        if self.faults.silent or self.state == STOPPED:
            return
        if len(data) == 8 and data[0] & 0xE0 in (0x20, 0x40):
            self._requested = struct.unpack_from("<HB", data, 1)
        if not self.faults.ignores(*self._requested):
            self.sdo.on_request(cob_id, data, timestamp)  # type: ignore[no-untyped-call]

    def _restore(self) -> None:
        self.values.clear()
        self.values.update(_defaults(self.object_dictionary))
        self.values.update({(0x1018, sub): value for sub, value in self._identity.items()})


def _variables(dictionary: ObjectDictionary) -> Iterator[ODVariable]:
    for entry in dictionary.values():
        members: Any = [entry] if isinstance(entry, ODVariable) else entry.values()
        yield from members


def _defaults(dictionary: ObjectDictionary) -> dict[Key, int]:
    return {
        (found.index, found.subindex): found.default or 0
        for found in _variables(dictionary)
        if found.data_type in INTEGER_TYPES
    }


def _signed(dictionary: ObjectDictionary) -> set[Key]:
    return {
        (found.index, found.subindex)
        for found in _variables(dictionary)
        if found.data_type in SIGNED_TYPES
    }
