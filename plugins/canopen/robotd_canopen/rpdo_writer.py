"""RPDOs of one axis: which are sent with a SYNC, and what they hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robotd_canopen.bus import Bus
from robotd_canopen.frame import Frame
from robotd_canopen.layout import AxisLayout
from robotd_canopen.mode_control import ModeControl
from robotd_canopen.modes import OperationMode
from robotd_canopen.pdo import Pdo
from robotd_canopen.scaling import Scaling, wrapped
from robotd_canopen.setpoint import Setpoint

CONTROLWORD, OPERATION_MODE, TARGET_POSITION = 0x6040, 0x6060, 0x607A
TARGET_VELOCITY, INTERPOLATION = 0x60FF, 0x60C1
_NOTHING_SENT = -1


@dataclass(frozen=True)
class _Rpdo:
    """One RPDO, with the frame that is sent again and again."""

    pdo: Pdo
    frame: Frame
    objects: list[int]
    always: bool  # it holds the controlword or the mode
    has_velocity: bool
    has_target: bool

    def is_sent(self, mode: ModeControl) -> bool:
        """True if an object of this RPDO matters in the present mode."""
        if self.has_velocity and not self.always:
            return mode.is_velocity
        in_profile = mode.requested is OperationMode.PROFILE_POSITION
        return self.always or not self.has_target or in_profile


class RpdoWriter:
    """Packs and sends the RPDOs of one axis. Control loop.

    Attributes:
        controlword: of the last frame; -1 before the first.
    """

    def __init__(self, layout: AxisLayout, scaling: Scaling) -> None:
        self.controlword = _NOTHING_SENT
        self._scaling = scaling
        self._rpdos = [
            _Rpdo(
                pdo,
                Frame(pdo.cob_id, bytes(pdo.layout.size)),
                [entry.base for entry in pdo.entries],
                always=pdo.holds(CONTROLWORD) or pdo.holds(OPERATION_MODE),
                has_velocity=pdo.holds(TARGET_VELOCITY),
                has_target=pdo.holds(TARGET_POSITION),
            )
            for pdo in layout.rpdos
        ]

    def send(self, bus: Bus, word: int, mode: ModeControl, setpoint: Setpoint) -> None:
        """Send the RPDOs of this SYNC, to take effect with the next one."""
        for rpdo in self._rpdos:
            if rpdo.is_sent(mode):
                values = [self._value(each, word, mode, setpoint) for each in rpdo.objects]
                rpdo.pdo.layout.pack_into(rpdo.frame.data, 0, *values)
                bus.send(rpdo.frame)
        self.controlword = word

    def _value(self, base: int, word: int, mode: ModeControl, setpoint: Setpoint) -> int:
        """Return the value of the mapped object ``base``."""
        if base == CONTROLWORD:
            return word
        if base == OPERATION_MODE:
            return int(mode.requested)
        if base == TARGET_VELOCITY:
            cyclic = mode.requested is OperationMode.CYCLIC_VELOCITY
            velocity = setpoint.velocity if cyclic else setpoint.target_velocity
            return self._scaling.velocity_units(velocity)
        if base == TARGET_POSITION and mode.requested is OperationMode.PROFILE_POSITION:
            return wrapped(setpoint.target_counts)
        if base in (TARGET_POSITION, INTERPOLATION) and math.isfinite(setpoint.position):
            return wrapped(self._scaling.counts(setpoint.position))
        return 0
