"""SDO client for tests, over the mailbox of a simulated slave."""

from __future__ import annotations

import struct

from tests.plugins.ethercat.line_master import MAILBOX, LineMaster

_SDO_REQUEST = struct.pack("<H", 2 << 12)
_INITIATE = struct.Struct("<BHB4s")


class Aborted(Exception):
    """SDO abort with ``code``."""

    def __init__(self, code: int) -> None:
        super().__init__(hex(code))
        self.code = code


class SdoClient:
    """Uploads and downloads objects of one slave.

    ``data_bytes`` limits the data in one message, so that short objects are segmented, too.
    """

    def __init__(self, master: LineMaster, slave: int = 0) -> None:
        self._master, self._slave = master, slave

    def request(self, data: bytes) -> bytes:
        """Exchange one SDO message; returns it from the command on. Raises Aborted."""
        assert self._master.mailbox_send(self._slave, _SDO_REQUEST + data) == 1
        answer = self._master.mailbox_receive(self._slave)
        assert answer is not None
        kind, response = answer
        assert kind == 3
        if response[2] == 0x80:
            raise Aborted(int.from_bytes(response[6:10], "little"))
        assert response[1] >> 4 == 3
        return response[2:]

    def upload(self, index: int, sub: int, *, complete: bool = False) -> bytes:
        command = 0x50 if complete else 0x40
        first = self.request(_INITIATE.pack(command, index, sub, bytes(4)))
        if first[0] & 2:
            return first[4 : 8 - (first[0] >> 2 & 3)]
        size = int.from_bytes(first[4:8], "little")
        data, toggle = first[8:], 0
        while len(data) < size:
            segment = self.request(bytes([0x60 | toggle]) + bytes(7))
            assert segment[0] & 0x10 == toggle
            data += segment[1 : len(segment) - (segment[0] >> 1 & 7)]
            assert bool(segment[0] & 1) == (len(data) == size)
            toggle ^= 0x10
        return data

    def download(
        self,
        index: int,
        sub: int,
        data: bytes,
        *,
        complete: bool = False,
        data_bytes: int = MAILBOX - 16,
    ) -> None:
        mark = 0x10 if complete else 0
        if 0 < len(data) <= 4 and not complete:
            command = 0x23 | 4 - len(data) << 2
            self.request(_INITIATE.pack(command, index, sub, data.ljust(4, b"\0")))
            return
        size = len(data).to_bytes(4, "little")
        head = _INITIATE.pack(0x21 | mark, index, sub, size)
        self.request(head + data[:data_bytes])
        position, toggle = data_bytes, 0
        while position < len(data):
            part = data[position : position + data_bytes]
            position += data_bytes
            last = int(position >= len(data))
            unused = max(0, 7 - len(part))
            answer = self.request(bytes([toggle | unused << 1 | last]) + part.ljust(7, b"\0"))
            assert answer[0] == 0x20 | toggle
            toggle ^= 0x10
