"""CANopen device written from CiA 301 alone: objects, SDO server, PDOs, NMT, heartbeat, EMCY.

Pure logic without a clock or bus: frames and the time go in, frames come out through ``send``.
"""

from __future__ import annotations

import heapq
import struct
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from enum import IntEnum
from itertools import count

import can
from tests.plugins.independent.canopen_objects import (
    CANNOT_STORE,
    DUMMY_BITS,
    INCOMPATIBLE,
    INVALID,
    MAPPED_OBJECTS,
    READ_ONLY,
    TOGGLE,
    UNKNOWN_COMMAND,
    VALUE_RANGE,
    WRONG_LENGTH,
    Abort,
    Entry,
    ObjectDictionary,
    Pdo,
    Stored,
)

SAVE, LOAD = 0x65766173, 0x64616F6C


class Nmt(IntEnum):
    """NMT states, with the values of the heartbeat."""

    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class CanopenDevice(ObjectDictionary):
    """CANopen device; a device profile derives from it and adds its objects."""

    boot_s = 0.0  # from a reset to the boot-up message
    self_starting = False
    heartbeat_copies = 1
    triggers: frozenset[int] = frozenset()  # objects that act on the values of others

    def __init__(self, node_id: int, send: Callable[[can.Message], None]) -> None:
        super().__init__()
        self.node_id = node_id
        self.send = send
        self.now = 0.0
        self.state = Nmt.INITIALISING
        self.reported: set[int] = set()  # indexes whose values were sent since the boot-up
        self.counts: Counter[str] = Counter()  # boots, stores, ...
        self._queue: list[tuple[float, int, can.Message]] = []
        self._order = count()
        # Of a segmented transfer: index, sub-index, data, number of the segment, its command.
        self._transfer: tuple[int, int, bytes, int, int] | None = None
        self._announced: int | None = None  # size of a segmented download
        self._stored: dict[tuple[int, int], int | str] = {}
        self._producers: dict[int, float] = {}  # heartbeats: when each node counts as lost
        self._heartbeat_at = self._boot_at = 0.0
        self._guard_toggle = 0x80  # of the last answer to node guarding; the first one is 0
        self.tpdos = [Pdo(self, number, True) for number in range(4)]
        self.rpdos = [Pdo(self, number, False) for number in range(4)]
        self._add_communication_objects()

    def _add_communication_objects(self) -> None:
        node = self.node_id
        self.add(0x1000, "Device type", Entry("", "I", 0, "const"))
        self.add(0x1001, "Error register", Entry("", "B", 0, "ro", "t"))
        errors = [Entry(f"Standard error field {n}", "I", 0, "ro") for n in range(1, 5)]
        self.add(0x1003, "Pre-defined error field", *errors)
        self.objects[0x1003, 0] = Entry("Number of errors", "B", 0, "rw")
        self.add(0x1005, "COB-ID SYNC", Entry("", "I", 0x80))
        self.add(0x1008, "Device name", Entry("", "s", "Independent CiA 402 drive", "const"))
        self.add(0x100A, "Software version", Entry("", "s", "1.0", "const"))
        self.add(0x1010, "Store parameters", Entry("Save all parameters", "I", 1), subs=(1,))
        self.add(0x1011, "Restore defaults", Entry("Restore all defaults", "I", 1), subs=(1,))
        self.add(0x1014, "COB-ID EMCY", Entry("", "I", 0x80 + node, "ro", relative=True))
        consumers = [Entry(f"Consumer heartbeat time {n}", "I") for n in range(1, 3)]
        self.add(0x1016, "Consumer heartbeat time", *consumers)
        self.add(0x1017, "Producer heartbeat time", Entry("", "H"))
        parts = ("Vendor-ID", 0x29C), ("Product code", 402), ("Revision number", 0x10001)
        identity = [Entry(name, "I", value, "ro") for name, value in parts]
        self.add(0x1018, "Identity", *identity, Entry("Serial number", "I", 1000 + node, "ro"))
        self.add(0x2000, "User text", Entry("", "s", "a text that needs segments"))
        self.hooks.update(
            {
                0x1003: self._clear_errors,
                0x1010: self._store,
                0x1011: self._restore,
                0x1016: self._consume,
                0x1017: self._produce,
            }
        )
        for pdo in (*self.tpdos, *self.rpdos):
            self._add_pdo(pdo)

    def _add_pdo(self, pdo: Pdo) -> None:
        number = pdo.communication & 3
        cob_id = (0x180 if pdo.transmits else 0x200) + 0x100 * number + self.node_id
        entries = [Entry("COB-ID", "I", cob_id | INVALID, relative=True)]
        entries += [Entry("Transmission type", "B", 255)]
        entries += [Entry("Inhibit time", "H"), Entry("Event timer", "H")]
        self.add(pdo.communication, "PDO communication parameter", *entries, subs=(1, 2, 3, 5))
        mapped = [Entry(f"Mapped object {n + 1}", "I") for n in range(MAPPED_OBJECTS)]
        self.add(pdo.mapping, "PDO mapping parameter", *mapped)
        self.objects[pdo.mapping, 0] = Entry("Number of mapped objects", "B")
        self.hooks[pdo.communication] = pdo.check_communication
        self.hooks[pdo.mapping] = pdo.check_mapping

    def announces(self, pdo: Pdo) -> bool:
        """Return whether an event-driven TPDO is sent when it becomes active."""
        return True

    # Rules of single objects

    def _clear_errors(self, sub: int, value: int) -> None:
        if value:
            raise Abort(VALUE_RANGE)

    def _store(self, sub: int, value: int) -> None:
        if value != SAVE:
            raise Abort(CANNOT_STORE)
        self.counts["stores"] += 1
        for key, entry in self.objects.items():
            if entry.access == "rw" and "r" not in entry.pdo and key[0] != 0x1003:
                self._stored[key] = entry.value
        raise Stored

    def _restore(self, sub: int, value: int) -> None:
        if value != LOAD:
            raise Abort(CANNOT_STORE)
        self._stored = {}
        raise Stored

    def _consume(self, sub: int, value: int) -> None:
        node = value >> 16 & 0x7F
        others = [self[0x1016, s] for s in (1, 2) if s != sub]
        if value & 0xFFFF and any(o & 0xFFFF and o >> 16 & 0x7F == node for o in others):
            raise Abort(INCOMPATIBLE)
        self._producers = {}

    def _produce(self, sub: int, value: int) -> None:
        self._heartbeat_at = self.now

    # NMT and time

    def restart(self, communication_only: bool = False) -> None:
        """Power-on, NMT reset node or reset communication."""
        self.state = Nmt.INITIALISING
        self._boot_at = self.now + self.boot_s
        for (index, sub), entry in self.objects.items():
            if index < 0x2000 or not communication_only:
                entry.value = self._stored.get((index, sub), entry.default)
        self.reported, self._queue, self._transfer, self._producers = set(), [], None, {}

    def _boot(self) -> None:
        self.counts["boots"] += 1
        self.transmit(0x700 + self.node_id, b"\0")
        self._heartbeat_at = self.now + self.get(0x1017) * 1e-3
        self.enter(Nmt.PRE_OPERATIONAL)
        if self.self_starting:
            self.enter(Nmt.OPERATIONAL)

    def enter(self, state: Nmt) -> None:
        if state is Nmt.OPERATIONAL and self.state is not state:
            for pdo in (*self.tpdos, *self.rpdos):
                pdo.restart()
        self.state = state

    def tick(self, now: float) -> None:
        """Let time pass: delayed frames, heartbeats, event-driven TPDOs."""
        self.now = now
        if self.state is Nmt.INITIALISING and now >= self._boot_at:
            self._boot()
        while self._queue and self._queue[0][0] <= now:
            self.send(heapq.heappop(self._queue)[2])
        if self.get(0x1017) and self.state is not Nmt.INITIALISING and now >= self._heartbeat_at:
            self._heartbeat_at = max(self._heartbeat_at + self[0x1017] * 1e-3, now)
            for _ in range(self.heartbeat_copies):
                self.transmit(0x700 + self.node_id, bytes([self.state]))
        for node, due in list(self._producers.items()):
            if now > due:
                del self._producers[node]
                self.heartbeat_lost()
        if self.state is Nmt.OPERATIONAL:
            for pdo in self.tpdos:
                pdo.poll()

    def heartbeat_lost(self) -> None:
        self.emergency(0x8130, 0x10)
        if self.state is Nmt.OPERATIONAL:
            self.enter(Nmt.PRE_OPERATIONAL)  # 0x1029 by its default

    def transmit(self, can_id: int, data: bytes, delay_s: float = 0.0) -> None:
        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        if delay_s:
            heapq.heappush(self._queue, (self.now + delay_s, next(self._order), message))
        else:
            self.send(message)

    def transmit_pdo(self, can_id: int, data: bytes) -> None:
        self.transmit(can_id, data)

    def emergency(self, code: int, register: int) -> None:
        """Send an EMCY; code 0 says that there is no error any more."""
        self[0x1001] = (self[0x1001] | register | 1) if code else 0
        if code:
            history = [code, *(self[0x1003, sub] for sub in range(1, 4))]
            for sub, value in enumerate(history, 1):
                self[0x1003, sub] = value
            self[0x1003] = min(self[0x1003] + 1, 4)
        if self.state in {Nmt.PRE_OPERATIONAL, Nmt.OPERATIONAL}:
            data = struct.pack("<HB5x", code, self[0x1001])
            self.transmit(self[0x1014] & 0x7FF, data)

    # Frames

    def receive(self, message: can.Message, now: float) -> None:
        self.now = now
        can_id, data = message.arbitration_id, bytes(message.data)
        if message.is_extended_id or self.state is Nmt.INITIALISING:
            return
        if can_id == 0:
            if len(data) == 2 and data[1] in {0, self.node_id}:
                self._command(data[0])
        elif can_id == 0x600 + self.node_id:
            if self.state is not Nmt.STOPPED and len(data) == 8:
                self._sdo(data)
        elif can_id == 0x700 + self.node_id and message.is_remote_frame:
            self._guard_toggle ^= 0x80
            self.transmit(can_id, bytes([self.state | self._guard_toggle]))
        elif 0x700 < can_id < 0x780:
            self._heard(can_id - 0x700)
        elif self.state is Nmt.OPERATIONAL:
            self._process_data(can_id, data, message.is_remote_frame)

    def _command(self, command: int) -> None:
        states = {1: Nmt.OPERATIONAL, 2: Nmt.STOPPED, 0x80: Nmt.PRE_OPERATIONAL}
        if command in states:
            self.enter(states[command])
        elif command in {0x81, 0x82}:
            self.restart(command == 0x82)

    def _heard(self, node: int) -> None:
        for sub in (1, 2):
            word = self.get(0x1016, sub)
            if word & 0xFFFF and word >> 16 & 0x7F == node:
                self._producers[node] = self.now + (word & 0xFFFF) * 1e-3

    def _process_data(self, can_id: int, data: bytes, remote: bool) -> None:
        if can_id == self[0x1005] & 0x7FF:
            self.counts["syncs"] += 1
            for pdo in self.tpdos:
                pdo.sync()
            self.apply([value for pdo in self.rpdos for value in pdo.take()])
            return
        for pdo in self.tpdos if remote else self.rpdos:
            if pdo.valid and pdo.cob_id & 0x7FF == can_id:
                pdo.request() if remote else pdo.receive(data)

    def apply(self, values: list[tuple[int, int, bytes]]) -> None:
        """Write the values of RPDOs, which are valid at once: what acts on others comes last."""
        for index, sub, value in sorted(values, key=lambda item: item[0] in self.triggers):
            if index not in DUMMY_BITS:
                with suppress(Abort):
                    self.put(index, sub, value)

    # SDO server

    def answer_delay_s(self, index: int, sub: int, write: bool) -> float | None:
        """Return the delay of an SDO response, None for no response at all."""
        return 0.0

    def _sdo(self, data: bytes) -> None:
        command = data[0] >> 5
        if command in {0, 3} and self._transfer:
            index, sub = self._transfer[:2]
        else:
            index, sub = struct.unpack_from("<HB", data, 1)
        if command == 4:
            self._transfer = None
            return
        try:
            answer = self._serve_sdo(command, data, index, sub)
        except Abort as abort:
            self._transfer = None
            answer = struct.pack("<BHBI", 0x80, index, sub, abort.code)
        delay_s = self.answer_delay_s(index, sub, command in {0, 1})
        if delay_s is not None:
            self.transmit(0x580 + self.node_id, answer.ljust(8, b"\0"), delay_s)

    def _serve_sdo(self, command: int, data: bytes, index: int, sub: int) -> bytes:
        if command == 1:
            return self._download(data, index, sub)
        if command == 2:
            return self._upload(index, sub)
        if command not in {0, 3} or self._transfer is None or self._transfer[4] != command:
            raise Abort(UNKNOWN_COMMAND)
        if data[0] >> 4 & 1 != self._transfer[3] & 1:
            raise Abort(TOGGLE)
        return self._download_segment(data) if command == 0 else self._upload_segment()

    def _download(self, data: bytes, index: int, sub: int) -> bytes:
        expedited, sized = data[0] & 2, data[0] & 1
        if expedited:
            length = 4 - (data[0] >> 2 & 3) if sized else min(4, self.find(index, sub).size)
            self._finish_download(index, sub, data[4 : 4 + length])
        else:
            if self.find(index, sub).access in {"ro", "const"}:
                raise Abort(READ_ONLY)
            self._announced = int.from_bytes(data[4:8], "little") if sized else None
            self._transfer = (index, sub, b"", 0, 0)
        return struct.pack("<BHB", 0x60, index, sub)

    def _download_segment(self, data: bytes) -> bytes:
        assert self._transfer
        index, sub, received, segment, _ = self._transfer
        received += data[1 : 8 - (data[0] >> 1 & 7)]
        self._transfer = (index, sub, received, segment + 1, 0)
        if data[0] & 1:
            self._transfer = None
            if self._announced not in {None, len(received)}:
                raise Abort(WRONG_LENGTH)
            self._finish_download(index, sub, received)
        return bytes([0x20 | (segment & 1) << 4])

    def _finish_download(self, index: int, sub: int, data: bytes) -> None:
        try:
            self.write(index, sub, data)
        except Stored:
            return

    def _upload(self, index: int, sub: int) -> bytes:
        value = self.read(index, sub)
        self.reported.add(index)
        if 0 < len(value) <= 4:
            return struct.pack("<BHB", 0x43 | (4 - len(value)) << 2, index, sub) + value
        self._transfer = (index, sub, value, 0, 3)
        return struct.pack("<BHBI", 0x41, index, sub, len(value))

    def _upload_segment(self) -> bytes:
        assert self._transfer
        index, sub, value, segment, _ = self._transfer
        part, rest = value[:7], value[7:]
        self._transfer = (index, sub, rest, segment + 1, 3) if rest else None
        return bytes([(segment & 1) << 4 | (7 - len(part)) << 1 | (not rest)]) + part
