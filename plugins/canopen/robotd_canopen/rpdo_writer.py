"""RPDOs of one axis: which are sent with a SYNC, and what they hold."""

from __future__ import annotations

from dataclasses import dataclass

from robotd_canopen.bus import Bus
from robotd_canopen.frame import Frame
from robotd_canopen.layout import AxisLayout
from robotd_canopen.pdo import Pdo
from robotd_cia402.object_numbers import MODE


@dataclass(frozen=True)
class _Rpdo:
    """One RPDO, with the frame that is sent again and again."""

    pdo: Pdo
    frame: Frame
    objects: list[int]
    modes: frozenset[int] | None  # as Pdo.modes


class RpdoWriter:
    """Packs and sends the RPDOs of one axis. Control loop.

    Attributes:
        values: object → value that the next SYNC takes; 0 before the first.
    """

    def __init__(self, layout: AxisLayout) -> None:
        self._rpdos = [
            _Rpdo(
                pdo,
                Frame(pdo.cob_id, bytes(pdo.layout.size)),
                [entry.base for entry in pdo.entries],
                pdo.modes,
            )
            for pdo in layout.rpdos
        ]
        self.values = {index: 0 for rpdo in self._rpdos for index in rpdo.objects}

    def send(self, bus: Bus) -> None:
        """Send the RPDOs of this SYNC, to take effect with the next one."""
        values = self.values
        for rpdo in self._rpdos:
            if rpdo.modes is None or values[MODE] in rpdo.modes:
                data = [values[index] for index in rpdo.objects]
                rpdo.pdo.layout.pack_into(rpdo.frame.data, 0, *data)
                bus.send(rpdo.frame)
