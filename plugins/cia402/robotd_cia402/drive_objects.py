"""Profile objects of one axis that are written by SDO while it is in use."""

from __future__ import annotations

from robotd_cia402.cyclic_objects import CyclicObjects


class DriveObjects:
    """Ramps, speeds and homing parameters; written only when they change. Worker threads."""

    def __init__(self, drive: CyclicObjects) -> None:
        self._drive = drive
        self._written: dict[tuple[int, int], int] = {}

    def write(self, index: int, sub: int, value: int) -> None:
        """Write object ``index`` of this axis, unless the drive has that value already.

        Raises OperationError and DeviceTimeout, as ``CyclicObjects.write``.
        """
        if self._written.get((index, sub)) != value:
            self._drive.write(index, sub, value)
            self._written[index, sub] = value

    def forget(self) -> None:
        """Write everything again when it is needed next: reset drive, or another scale."""
        self._written.clear()
