"""Profile objects of one axis that are written by SDO while it is in use."""

from __future__ import annotations

from robotd_canopen.layout import AxisLayout
from robotd_canopen.sdo import Sdo


class DriveObjects:
    """Ramps, speeds and homing parameters; written only when they change. Worker threads."""

    def __init__(self, layout: AxisLayout, sdo: Sdo) -> None:
        self._layout, self._sdo = layout, sdo
        self._written: dict[tuple[int, int], int] = {}

    def write(self, base: int, sub: int, value: int) -> None:
        """Write object ``base`` of this axis, unless the drive has that value already.

        Raises OperationError and DeviceTimeout, as ``Sdo.write``.
        """
        if self._written.get((base, sub)) != value:
            self._sdo.write(self._layout.index(base), sub, value)
            self._written[base, sub] = value

    def forget(self) -> None:
        """Write everything again when it is needed next: reset drive, or another scale."""
        self._written.clear()
