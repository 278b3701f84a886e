"""RPDOs of one axis: which are sent with a SYNC, and what they hold."""

from __future__ import annotations

from dataclasses import dataclass

from robotd_canopen.bus import Bus
from robotd_canopen.frame import Frame
from robotd_canopen.layout import AxisLayout
from robotd_canopen.pdo import Pdo
from robotd_cia402.modes import VELOCITY, OperationMode
from robotd_cia402.object_numbers import (
    CONTROLWORD,
    MODE,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
)


@dataclass(frozen=True)
class _Rpdo:
    """One RPDO, with the frame that is sent again and again."""

    pdo: Pdo
    frame: Frame
    objects: list[int]
    always: bool  # it holds the controlword or the mode
    has_velocity: bool
    has_torque: bool
    has_target: bool

    def is_sent(self, mode: int) -> bool:
        """True if an object of this RPDO matters in operation mode ``mode``."""
        if self.has_velocity and not self.always:
            return mode in VELOCITY
        if self.has_torque and not self.always:
            return mode == OperationMode.CYCLIC_TORQUE
        in_profile = mode == OperationMode.PROFILE_POSITION
        return self.always or not self.has_target or in_profile


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
                always=pdo.holds(CONTROLWORD) or pdo.holds(MODE),
                has_velocity=pdo.holds(TARGET_VELOCITY),
                has_torque=pdo.holds(TARGET_TORQUE),
                has_target=pdo.holds(TARGET_POSITION),
            )
            for pdo in layout.rpdos
        ]
        self.values = {index: 0 for rpdo in self._rpdos for index in rpdo.objects}

    def send(self, bus: Bus) -> None:
        """Send the RPDOs of this SYNC, to take effect with the next one."""
        values = self.values
        for rpdo in self._rpdos:
            if rpdo.is_sent(values[MODE]):
                data = [values[index] for index in rpdo.objects]
                rpdo.pdo.layout.pack_into(rpdo.frame.data, 0, *data)
                bus.send(rpdo.frame)
