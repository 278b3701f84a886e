"""SDO server of CoE: transfers of all kinds, complete access, and the lists of the objects."""

from __future__ import annotations

import struct
from collections.abc import Callable

from robotd_ethercat.simulated.object_access import (
    RX_PDOS,
    TX_PDOS,
    AbortCode,
    ObjectAccess,
    SdoAbort,
    SlaveFaults,
)
from robotd_ethercat.simulated.object_dictionary import Access, ObjectCode, ObjectDictionary

_SERVICE = struct.Struct("<H")
_REQUEST, _RESPONSE = _SERVICE.pack(2 << 12), _SERVICE.pack(3 << 12)
_INITIATE = struct.Struct("<BHB4s")
_SEGMENT_DOWN, _DOWN, _UP, _SEGMENT_UP, _ABORT = 0, 1, 2, 3, 4
_EXPEDITED, _SIZED, _COMPLETE, _TOGGLE, _LAST = 0x02, 0x01, 0x10, 0x10, 0x01
_HEADER = 10  # CoE header, command, index, subindex, size
_SEGMENT_HEADER = 3  # CoE header, command
_MIN_SEGMENT = 7
_MAX_BYTES = 1_000_000

Object = tuple[int, int, bool]  # index, subindex, complete access
_COE = (8 << 12).to_bytes(2, "little")
_INFORMATION_HEADER = struct.Struct("<BBH")  # opcode, reserved, fragments left
_LIST, _OBJECT, _ENTRY, _ERROR = 1, 3, 5, 7  # requests; responses are one higher
_INCOMPLETE = 0x80
_LIST_KINDS = range(1, 6)


class SdoInformation:
    """Answers information requests about ``objects``.

    Args:
        capacity: returns the bytes of a message, CoE header included.
    """

    def __init__(self, objects: ObjectDictionary, capacity: Callable[[], int]) -> None:
        self._objects, self._capacity = objects, capacity

    def handle(self, request: bytes) -> list[bytes]:
        """Return the messages that answer ``request``, all with CoE header."""
        try:
            return self._answer(request)
        except SdoAbort as abort:
            return [
                _COE + _INFORMATION_HEADER.pack(_ERROR, 0, 0) + abort.code.to_bytes(4, "little")
            ]

    def _answer(self, request: bytes) -> list[bytes]:
        opcode = request[2] & 0x7F if len(request) >= 8 else 0
        if opcode == _LIST:
            return self._fragments(_LIST + 1, self._list(*struct.unpack_from("<H", request, 6)))
        if opcode == _OBJECT:
            index = struct.unpack_from("<H", request, 6)[0]
            return self._fragments(_OBJECT + 1, self._object(index))
        if opcode == _ENTRY and len(request) >= 10:
            index, sub = struct.unpack_from("<HB", request, 6)
            return self._fragments(_ENTRY + 1, self._entry(index, sub))
        raise SdoAbort(AbortCode.UNKNOWN_COMMAND)

    def _fragments(self, opcode: int, data: bytes) -> list[bytes]:
        room = max(2, (self._capacity() - len(_COE) - _INFORMATION_HEADER.size) // 2 * 2)
        parts = [data[start : start + room] for start in range(0, len(data), room)]
        return [
            _COE + _INFORMATION_HEADER.pack(opcode | (_INCOMPLETE if left else 0), 0, left) + part
            for left, part in zip(reversed(range(len(parts))), parts, strict=True)
        ]

    def _list(self, kind: int) -> bytes:
        if kind == 0:
            lengths = [len(self._indices(number)) for number in _LIST_KINDS]
            return struct.pack("<H5H", 0, *lengths)
        if kind not in _LIST_KINDS:
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
        indices = self._indices(kind)
        return struct.pack(f"<H{len(indices)}H", kind, *indices)

    def _indices(self, kind: int) -> list[int]:
        """List 1: all, 2: mappable to RxPDO, 3: to TxPDO, 4: to store, 5: start-up."""
        needed = {1: 0xFFFF, 2: Access.RX_PDO, 3: Access.TX_PDO}.get(kind, 0)
        return [
            index
            for index, found in sorted(self._objects.objects.items())
            if any(entry.access & needed for entry in found.entries.values())
        ]

    def _object(self, index: int) -> bytes:
        found = self._objects.objects.get(index)
        if found is None:
            raise SdoAbort(AbortCode.NO_OBJECT)
        kind = found.entries[0].kind if found.code is ObjectCode.VAR else _record_type(index)
        highest = max(found.entries)
        head = struct.pack("<HHBB", index, kind, highest, found.code)
        return head + found.name.encode("ascii", "replace")

    def _entry(self, index: int, sub: int) -> bytes:
        found = self._objects.objects.get(index)
        if found is None:
            raise SdoAbort(AbortCode.NO_OBJECT)
        entry = found.entries.get(sub)
        if entry is None:
            raise SdoAbort(AbortCode.NO_SUBINDEX)
        head = struct.pack("<HBBHHH", index, sub, 0, entry.kind, entry.bits, entry.access)
        return head + entry.name.encode("ascii", "replace")


def _record_type(index: int) -> int:
    """Return the data type of a record: PDO mapping, identity, or PDO parameter."""
    if index in RX_PDOS or index in TX_PDOS:
        return 0x21
    return 0x23 if index == 0x1018 else 0x20


class SdoServer:
    """One transfer at a time, as the mailbox allows it.

    Args:
        capacity: returns the bytes of a response, CoE header included.
    """

    def __init__(
        self, access: ObjectAccess, faults: SlaveFaults, capacity: Callable[[], int]
    ) -> None:
        self._access, self._faults, self._capacity = access, faults, capacity
        self._object: Object = (0, 0, False)
        self.reset()

    def reset(self) -> None:
        """Forget a transfer."""
        self._upload: bytes | None = None
        self._download: bytearray | None = None
        self._expected = self._toggle = 0

    def handle(self, request: bytes) -> bytes | None:
        """Return the response to a request, both with CoE header; None for no response."""
        try:
            return self._answer(request)
        except SdoAbort as abort:
            self.reset()
            return self._abort(abort.code)

    def _answer(self, request: bytes) -> bytes | None:
        command = request[2] if len(request) > _SEGMENT_HEADER else 0xFF
        kind = command >> 5
        if kind in (_DOWN, _UP):
            return self._initiate(kind, request)
        if kind == _SEGMENT_UP:
            return self._upload_segment(command)
        if kind == _SEGMENT_DOWN:
            return self._download_segment(command, request[_SEGMENT_HEADER:])
        if kind == _ABORT:
            self.reset()
            return None
        raise SdoAbort(AbortCode.UNKNOWN_COMMAND)

    def _initiate(self, kind: int, request: bytes) -> bytes | None:
        self.reset()
        if len(request) < _HEADER:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        command, index, sub, data = _INITIATE.unpack_from(request, 2)
        self._object = index, sub, bool(command & _COMPLETE)
        if self._faults.ignores(index, sub):
            return None
        if command & _COMPLETE and sub > 1:
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
        if kind == _UP:
            return self._begin_upload()
        if command & _EXPEDITED:
            size = 4 - (command >> 2 & 3) if command & _SIZED else 4
            self._write(data[:size])
            return self._downloaded()
        return self._begin_download(int.from_bytes(data, "little"), request[_HEADER:])

    def _begin_upload(self) -> bytes:
        index, sub, complete = self._object
        data = self._access.read_all(index, sub) if complete else self._access.read(index, sub)
        mark = _UP << 5 | (_COMPLETE if complete else 0) | _SIZED
        if 0 < len(data) <= 4:
            command = mark | _EXPEDITED | 4 - len(data) << 2
            return _RESPONSE + _INITIATE.pack(command, index, sub, data.ljust(4, b"\0"))
        room = max(0, self._capacity() - _HEADER)
        if len(data) > room:
            self._upload = data[room:]
        size = len(data).to_bytes(4, "little")
        return _RESPONSE + _INITIATE.pack(mark, index, sub, size) + data[:room]

    def _upload_segment(self, command: int) -> bytes:
        if self._upload is None:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        self._check_toggle(command)
        room = max(_MIN_SEGMENT, self._capacity() - _SEGMENT_HEADER)
        part, rest = self._upload[:room], self._upload[room:]
        unused = max(0, _MIN_SEGMENT - len(part))
        answer = command & _TOGGLE | unused << 1 | (0 if rest else _LAST)
        self._upload = rest or None
        return _RESPONSE + bytes([answer]) + part.ljust(_MIN_SEGMENT, b"\0")

    def _begin_download(self, size: int, data: bytes) -> bytes:
        if size > _MAX_BYTES:
            raise SdoAbort(AbortCode.TOO_LONG)
        if len(data) >= size:
            self._write(data[:size])
        else:
            self._download, self._expected = bytearray(data), size
        return self._downloaded()

    def _download_segment(self, command: int, data: bytes) -> bytes:
        if self._download is None:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        self._check_toggle(command)
        unused = command >> 1 & 7 if len(data) == _MIN_SEGMENT else 0
        self._download += data[: len(data) - unused]
        if len(self._download) > self._expected:
            raise SdoAbort(AbortCode.TOO_LONG)
        if command & _LAST:
            if len(self._download) < self._expected:
                raise SdoAbort(AbortCode.TOO_SHORT)
            data, self._download = bytes(self._download), None
            self._write(data)
        return _RESPONSE + bytes([0x20 | command & _TOGGLE]) + bytes(_MIN_SEGMENT)

    def _check_toggle(self, command: int) -> None:
        if command & _TOGGLE != self._toggle:
            raise SdoAbort(AbortCode.TOGGLE)
        self._toggle ^= _TOGGLE

    def _write(self, data: bytes) -> None:
        index, sub, complete = self._object
        if complete:
            self._access.write_all(index, sub, data)
        else:
            self._access.write(index, sub, data)

    def _downloaded(self) -> bytes:
        index, sub, complete = self._object
        command = 0x60 | (_COMPLETE if complete else 0)
        return _RESPONSE + _INITIATE.pack(command, index, sub, bytes(4))

    def _abort(self, code: int) -> bytes:
        index, sub, _ = self._object
        return _REQUEST + _INITIATE.pack(0x80, index, sub, code.to_bytes(4, "little"))
