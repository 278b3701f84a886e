"""SDO information service: list, description and entries of the object dictionary."""

from __future__ import annotations

import struct
from collections.abc import Callable

from robotd_ethercat.simulated.object_access import RX_PDOS, TX_PDOS, AbortCode, SdoAbort
from robotd_ethercat.simulated.object_dictionary import Access, ObjectCode, ObjectDictionary

_COE = (8 << 12).to_bytes(2, "little")
_HEADER = struct.Struct("<BBH")  # opcode, reserved, fragments left
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
            return [_COE + _HEADER.pack(_ERROR, 0, 0) + abort.code.to_bytes(4, "little")]

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
        room = max(2, (self._capacity() - len(_COE) - _HEADER.size) // 2 * 2)
        parts = [data[start : start + room] for start in range(0, len(data), room)]
        return [
            _COE + _HEADER.pack(opcode | (_INCOMPLETE if left else 0), 0, left) + part
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
