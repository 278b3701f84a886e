"""Access of the SDO server to an object dictionary: rights, lengths, rules of PDO objects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from robotd_cia402.simulated import DriveFaults
from robotd_ethercat.simulated.al_state import AlState
from robotd_ethercat.simulated.object_dictionary import Access, Entry, ObjectDictionary

RX_PDOS, TX_PDOS = range(0x1600, 0x1800), range(0x1A00, 0x1C00)
ASSIGNMENTS = {0x1C12: RX_PDOS, 0x1C13: TX_PDOS}
_WRITE = {AlState.PRE_OP: 0x08, AlState.SAFE_OP: 0x10, AlState.OP: 0x20}


class AbortCode(IntEnum):
    """Reasons for which an SDO transfer is aborted."""

    TOGGLE = 0x05030000
    UNKNOWN_COMMAND = 0x05040001
    UNSUPPORTED_ACCESS = 0x06010000
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    COUNT_NOT_ZERO = 0x06010003
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_LENGTH = 0x06040042
    LENGTH = 0x06070010
    TOO_LONG = 0x06070012
    TOO_SHORT = 0x06070013
    NO_SUBINDEX = 0x06090011
    GENERAL = 0x08000000
    STATE = 0x08000022


class SdoAbort(Exception):
    """Abort of a transfer with ``code``."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort 0x{code:08X}")
        self.code = int(code)


@dataclass
class SlaveFaults(DriveFaults):
    """Faults of objects and of a drive's motion; the defaults are a healthy slave.

    Attributes:
        unpadded: an upload by complete access has one byte for subindex 0 instead of two.
    """

    unpadded: bool = False


class ObjectAccess:
    """Reads and writes objects by the rules of their entries. Raises SdoAbort.

    Args:
        state: returns the AL state.
        on_written: called after an object was written.
    """

    def __init__(
        self,
        objects: ObjectDictionary,
        faults: SlaveFaults,
        state: Callable[[], AlState],
        on_written: Callable[[int, int], None],
    ) -> None:
        self.objects, self._faults = objects, faults
        self._state, self._on_written = state, on_written

    def read(self, index: int, sub: int) -> bytes:
        """Return one entry."""
        entry = self._entry(index, sub)
        if not entry.access & Access.READ:
            raise SdoAbort(AbortCode.WRITE_ONLY)
        return self.objects.encode(index, sub)

    def read_all(self, index: int, first: int) -> bytes:
        """Return all entries from ``first`` (0 or 1) on; subindex 0 takes two bytes."""
        self._entry(index, first)
        parts = [self.read(index, sub) for sub in self._subs(index, first)]
        if first == 0 and not self._faults.unpadded:
            parts[0] = parts[0].ljust(2, b"\0")
        return b"".join(parts)

    def write(self, index: int, sub: int, data: bytes) -> None:
        """Write one entry."""
        entry = self._entry(index, sub)
        if not entry.access & Access.WRITE:
            raise SdoAbort(AbortCode.READ_ONLY)
        if not entry.access & _WRITE.get(self._state(), 0):
            raise SdoAbort(AbortCode.STATE)
        if len(data) > entry.size:
            raise SdoAbort(AbortCode.TOO_LONG)
        if len(data) < entry.size and not isinstance(entry.default, bytes):
            raise SdoAbort(AbortCode.TOO_SHORT)
        self._check_pdo(index, sub, int.from_bytes(data, "little"))
        self.objects.decode(index, sub, data)
        self._on_written(index, sub)

    def write_all(self, index: int, first: int, data: bytes) -> None:
        """Write all entries from ``first`` on, subindex 0 last as PDO objects need it."""
        self._entry(index, first)
        count, offset = None, 0
        if first == 0:
            count, offset = data[:1], 2
            if self._is_pdo(index):
                self.write(index, 0, b"\0")
        for sub in self._subs(index, 1):
            size = self.objects.objects[index].entries[sub].size
            part = data[offset : offset + size]
            if not part:
                break
            self.write(index, sub, part)
            offset += size
        if count is not None and self._is_pdo(index):
            self.write(index, 0, count)

    def _subs(self, index: int, first: int) -> list[int]:
        """Subindices in use; of PDO objects those up to the value of subindex 0."""
        return [sub for sub in sorted(self.objects.objects[index].entries) if sub >= first]

    def _entry(self, index: int, sub: int) -> Entry:
        code = self._faults.abort_code(index, sub)
        if code is not None:
            raise SdoAbort(code)
        entry = self.objects.entry(index, sub)
        if entry is None:
            known = index in self.objects.objects
            raise SdoAbort(AbortCode.NO_SUBINDEX if known else AbortCode.NO_OBJECT)
        return entry

    @staticmethod
    def _is_pdo(index: int) -> bool:
        return index in ASSIGNMENTS or index in RX_PDOS or index in TX_PDOS

    def _check_pdo(self, index: int, sub: int, value: int) -> None:
        """Check a write to a mapping or an assignment."""
        if not self._is_pdo(index):
            return
        if sub:
            if self.objects.values[index, 0]:
                raise SdoAbort(AbortCode.COUNT_NOT_ZERO)
            self._check_mappable(index, value)
        elif value > len(self.objects.objects[index].entries) - 1:
            raise SdoAbort(AbortCode.PDO_LENGTH)

    def _check_mappable(self, index: int, value: int) -> None:
        if index in ASSIGNMENTS:
            if value and (value not in ASSIGNMENTS[index] or value not in self.objects.objects):
                raise SdoAbort(AbortCode.NOT_MAPPABLE)
            return
        mapped, sub, bits = value >> 16, value >> 8 & 0xFF, value & 0xFF
        if mapped == 0:  # a gap
            return
        entry = self.objects.entry(mapped, sub)
        needed = Access.RX_PDO if index in RX_PDOS else Access.TX_PDO
        if entry is None or not entry.access & needed or entry.bits != bits:
            raise SdoAbort(AbortCode.NOT_MAPPABLE)
