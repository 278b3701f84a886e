"""Profile objects of one axis that are written by SDO while it is in use."""

from __future__ import annotations

from robotd_cia402.cyclic_objects import CyclicObjects, SdoAbort

_MISSING = (0x06020000, 0x06090011)  # abort codes: no such object, no such subindex


class DriveObjects:
    """Ramps, speeds and homing parameters; written only when they change. Worker threads."""

    def __init__(self, drive: CyclicObjects) -> None:
        self._drive = drive
        self._written: dict[tuple[int, int], int] = {}
        self._reported: set[int] = set()
        self._missing: set[int] = set()

    def write(self, index: int, sub: int, value: int) -> None:
        """Write object ``index`` of this axis, unless the drive has that value already.

        Raises OperationError and DeviceTimeout, as ``CyclicObjects.write``.
        """
        if self._written.get((index, sub)) != value:
            self._drive.write(index, sub, value)
            self._written[index, sub] = value

    def write_optional(self, index: int, value: int) -> bool:
        """Write an object if the drive has it; return whether it does. Raises as ``write``."""
        if index in self._missing:
            return False
        try:
            if (index, 0) in self._written or self._drive.writable(index, 0):
                self.write(index, 0, value)
                return True
        except SdoAbort as error:
            if error.code not in _MISSING:
                raise
        self._missing.add(index)
        return False

    def is_news(self, index: int) -> bool:
        """Return True the first time that an object is reported as not written."""
        news = index not in self._reported
        self._reported.add(index)
        return news

    def forget(self) -> None:
        """Write everything again when it is needed next: reset drive, or another scale."""
        self._written.clear()
