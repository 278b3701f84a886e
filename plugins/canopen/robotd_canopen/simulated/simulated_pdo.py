"""PDOs of a simulated node, configured by its objects 0x1400 to 0x1BFF."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

_FORMATS = {8: "B", 16: "H", 32: "I", 64: "Q"}
_INVALID = 1 << 31
_COB_ID = 0x7FF
_LAST_SYNCHRONOUS = 240

Key = tuple[int, int]


@dataclass
class _Pdo:
    cob_id: int
    transmission: int
    keys: list[Key]
    bits: list[int]
    layout: struct.Struct
    signed_layout: struct.Struct
    pending: bytes | None = None
    count: int = 0
    sent: bytes = field(default=b"")

    @property
    def synchronous(self) -> bool:
        return self.transmission <= _LAST_SYNCHRONOUS


class PdoSet:
    """Mapping between frames and ``values``; read from them at each NMT start.

    ``signed`` are the objects with a signed type.
    """

    def __init__(self, values: dict[Key, int], signed: set[Key]) -> None:
        self._values = values
        self._signed = signed
        self._receive: dict[int, _Pdo] = {}
        self._transmit: list[_Pdo] = []

    def configure(self) -> None:
        """Read the communication and mapping parameters again."""
        self._receive = {pdo.cob_id: pdo for pdo in self._read(0x1400)}
        self._transmit = list(self._read(0x1800))
        for pdo in self._transmit:
            if not pdo.synchronous:
                pdo.sent = self._pack(pdo)  # the NMT start alone is no event

    def receive(self, cob_id: int, data: bytes) -> bool | None:
        """Take a frame; return its effect.

        None: not ours, or for the next SYNC; False: in effect; True: too short.
        """
        pdo = self._receive.get(cob_id)
        if pdo is None:
            return None
        if len(data) < pdo.layout.size:
            return True
        if pdo.synchronous:
            pdo.pending = bytes(data)
            return None
        self._store(pdo, data)
        return False

    def apply(self) -> None:
        """SYNC: the RPDOs received since the last one take effect."""
        for pdo in self._receive.values():
            if pdo.pending is not None:
                self._store(pdo, pdo.pending)
                pdo.pending = None

    def synchronous(self) -> Iterator[tuple[int, bytes]]:
        """TPDOs due with this SYNC; of type 0 those that have changed."""
        for pdo in self._transmit:
            if not pdo.synchronous:
                continue
            pdo.count += 1
            if pdo.count >= pdo.transmission:
                data = self._pack(pdo)
                if pdo.transmission or data != pdo.sent:
                    pdo.count, pdo.sent = 0, data
                    yield pdo.cob_id, data

    def changed(self, *, always: bool = False) -> Iterator[tuple[int, bytes]]:
        """Event-driven TPDOs that have changed since they were sent, or since ``configure``."""
        for pdo in self._transmit:
            if not pdo.synchronous:
                data = self._pack(pdo)
                if always or data != pdo.sent:
                    pdo.sent = data
                    yield pdo.cob_id, data

    def _store(self, pdo: _Pdo, data: bytes) -> None:
        self._values.update(zip(pdo.keys, pdo.signed_layout.unpack_from(data), strict=True))

    def _pack(self, pdo: _Pdo) -> bytes:
        values = self._values
        return pdo.layout.pack(
            *(values[key] & (1 << bits) - 1 for key, bits in zip(pdo.keys, pdo.bits, strict=True))
        )

    def _read(self, first: int) -> Iterator[_Pdo]:
        values = self._values
        for parameter in range(first, first + 0x200):
            cob_id = values.get((parameter, 1), _INVALID)
            if cob_id & _INVALID:
                continue
            mapping = parameter + 0x200
            entries = [values[mapping, sub] for sub in range(1, values[mapping, 0] + 1)]
            bits = [entry & 0xFF for entry in entries]
            keys = [(entry >> 16, entry >> 8 & 0xFF) for entry in entries]
            letters = [_FORMATS[size] for size in bits]
            signed = [
                letter.lower() if key in self._signed else letter
                for key, letter in zip(keys, letters, strict=True)
            ]
            yield _Pdo(
                cob_id & _COB_ID,
                values.get((parameter, 2), 255),
                keys,
                bits,
                struct.Struct("<" + "".join(letters)),
                struct.Struct("<" + "".join(signed)),
            )
