"""RPDOs of one axis: which are sent with a SYNC, and what they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robotd_canopen.bus import Bus
from robotd_canopen.frame import Frame
from robotd_canopen.layout import AxisLayout
from robotd_canopen.pdo import Pdo
from robotd_cia402.object_numbers import MODE, OUTPUTS

_MODE = OUTPUTS.index(MODE)


@dataclass(frozen=True)
class _Rpdo:
    """One RPDO, with the frame that is sent again and again."""

    pdo: Pdo
    frame: Frame
    places: list[int]  # of its objects in OUTPUTS, or of the 0 behind them
    modes: frozenset[int] | None  # as Pdo.modes


class RpdoWriter:
    """Packs and sends the RPDOs of one axis. Control loop.

    Attributes:
        values: of the objects in ``OUTPUTS``, which the next SYNC takes; 0 before the first.
    """

    def __init__(self, layout: AxisLayout) -> None:
        self._rpdos = [
            _Rpdo(
                pdo,
                Frame(pdo.cob_id, bytes(pdo.layout.size)),
                [_place(entry.base) for entry in pdo.entries],
                pdo.modes,
            )
            for pdo in layout.rpdos
        ]
        self.values: Sequence[int] = (0,) * len(OUTPUTS)

    def send(self, bus: Bus) -> None:
        """Send the RPDOs of this SYNC, to take effect with the next one."""
        values = (*self.values, 0)
        mode = values[_MODE]
        for rpdo in self._rpdos:
            if rpdo.modes is None or mode in rpdo.modes:
                data = [values[place] for place in rpdo.places]
                rpdo.pdo.layout.pack_into(rpdo.frame.data, 0, *data)
                bus.send(rpdo.frame)


def _place(index: int) -> int:
    """Return the place of an object in ``OUTPUTS``; behind them where none sets it."""
    return OUTPUTS.index(index) if index in OUTPUTS else len(OUTPUTS)
