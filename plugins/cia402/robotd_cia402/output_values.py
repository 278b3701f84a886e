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
    TARGET_TORQUE,
    TARGET_VELOCITY,
)
from robotd_cia402.scaling import Scaling, wrapped
from robotd_cia402.setpoint import Setpoint

_NOTHING_SENT = -1
_PROFILE_POSITION = OperationMode.PROFILE_POSITION


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
        put, requested, position = self._drive.put, mode.requested, setpoint.position
        counts = wrapped(self._scaling.counts(position)) if math.isfinite(position) else 0
        target = setpoint.target_counts
        put(CONTROLWORD, word)
        put(MODE, requested)
        put(INTERPOLATION, counts)
        put(TARGET_POSITION, wrapped(target) if requested is _PROFILE_POSITION else counts)
        put(TARGET_VELOCITY, self._velocity(mode, setpoint) if mode.is_velocity else 0)
        put(TARGET_TORQUE, self._scaling.torque_units(setpoint.torque) if mode.is_torque else 0)
        self.controlword = word

    def _velocity(self, mode: ModeControl, setpoint: Setpoint) -> int:
        cyclic = mode.requested is OperationMode.CYCLIC_VELOCITY
        velocity = setpoint.velocity if cyclic else setpoint.target_velocity
        return self._scaling.velocity_units(velocity)
