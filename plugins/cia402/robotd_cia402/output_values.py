"""Values of one axis in the cyclic frames to its drive."""

from __future__ import annotations

import math

from robotd_cia402.cyclic_objects import CyclicObjects
from robotd_cia402.mode_control import ModeControl
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import (
    CONTROLWORD,
    INTERPOLATION,
    MODE,
    TARGET_POSITION,
    TARGET_VELOCITY,
)
from robotd_cia402.scaling import Scaling, wrapped
from robotd_cia402.setpoint import Setpoint

_NOTHING_SENT = -1


class OutputValues:
    """Computes the outputs of one axis for each frame. Control loop.

    Attributes:
        controlword: of the last frame; -1 before the first.
    """

    def __init__(self, drive: CyclicObjects, scaling: Scaling) -> None:
        self.controlword = _NOTHING_SENT
        self._drive, self._scaling = drive, scaling

    def put(self, word: int, mode: ModeControl, setpoint: Setpoint) -> None:
        """Put the values into the next frame, with controlword ``word``."""
        drive = self._drive
        for index in drive.outputs:
            drive.put(index, self._value(index, word, mode, setpoint))
        self.controlword = word

    def _value(self, index: int, word: int, mode: ModeControl, setpoint: Setpoint) -> int:
        if index == CONTROLWORD:
            return word
        if index == MODE:
            return int(mode.requested)
        if index == TARGET_VELOCITY and mode.is_velocity:
            cyclic = mode.requested is OperationMode.CYCLIC_VELOCITY
            velocity = setpoint.velocity if cyclic else setpoint.target_velocity
            return self._scaling.velocity_units(velocity)
        if index == TARGET_POSITION and mode.requested is OperationMode.PROFILE_POSITION:
            return wrapped(setpoint.target_counts)
        if index in (TARGET_POSITION, INTERPOLATION) and math.isfinite(setpoint.position):
            return wrapped(self._scaling.counts(setpoint.position))
        return 0
