"""Process data of a slave: objects packed into SyncManager memory by the PDO mapping."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from robotd_ethercat.simulated.object_dictionary import Key, ObjectDictionary

_FORMATS = {8: "b", 16: "h", 32: "i"}
_GAP = (0, 0)


class PdoImage:
    """Layout of one direction, as assignment and mapping objects define it now.

    Args:
        assignment: 0x1C12 or 0x1C13.

    Attributes:
        entries: mapped objects with their bits, in order.
        size: bytes.
        valid: False if an entry does not exist.
    """

    def __init__(self, objects: ObjectDictionary, assignment: int) -> None:
        self._values = objects.values
        self.entries = list(mapped_entries(objects, assignment))
        bits = sum(size for _, size in self.entries)
        self.size = (bits + 7) // 8
        self.valid = all(key[0] == 0 or key in self._values for key, _ in self.entries)
        self._keys = [key for key, _ in self.entries]
        self._signed = [_is_signed(objects, key) for key in self._keys]
        self._layout = self._struct()
        self._packs = bool(self._layout) and _GAP not in self._keys and self.valid

    def pack(self, area: memoryview) -> None:
        """Write the values of the objects to ``area``."""
        values = self._values
        if self._packs and self._layout is not None:
            self._layout.pack_into(area, 0, *[values[key] for key in self._keys])
            return
        image = position = 0
        for key, bits in self.entries:
            image |= (values.get(key, 0) & (1 << bits) - 1) << position
            position += bits
        area[: self.size] = image.to_bytes(self.size, "little")

    def unpack(self, area: memoryview) -> None:
        """Set the objects from ``area``."""
        if self._packs and self._layout is not None:
            self._values.update(zip(self._keys, self._layout.unpack_from(area), strict=True))
            return
        image = int.from_bytes(area[: self.size], "little")
        for (key, bits), signed in zip(self.entries, self._signed, strict=True):
            value = image & (1 << bits) - 1
            image >>= bits
            if key in self._values:
                self._values[key] = value - (1 << bits) if signed and value >> bits - 1 else value

    def _struct(self) -> struct.Struct | None:
        """Return the layout if all entries are whole numbers of 8, 16 or 32 bits."""
        if any(bits not in _FORMATS for _, bits in self.entries):
            return None
        letters = [
            _FORMATS[bits] if signed else _FORMATS[bits].upper()
            for (_, bits), signed in zip(self.entries, self._signed, strict=True)
        ]
        return struct.Struct("<" + "".join(letters))


def mapped_entries(objects: ObjectDictionary, assignment: int) -> Iterator[tuple[Key, int]]:
    """Yield the objects of all assigned PDOs with their bits; index 0 is a gap."""
    values = objects.values
    for number in range(1, values.get((assignment, 0), 0) + 1):
        pdo = values.get((assignment, number), 0)
        for sub in range(1, values.get((pdo, 0), 0) + 1):
            entry = values.get((pdo, sub), 0)
            yield (entry >> 16, entry >> 8 & 0xFF), entry & 0xFF


def _is_signed(objects: ObjectDictionary, key: Key) -> bool:
    entry = objects.entry(*key)
    return entry is not None and entry.signed
