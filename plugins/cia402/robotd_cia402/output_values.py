"""Values of one axis in the cyclic frames to its drive."""

from __future__ import annotations

import math

from robotd_cia402.cyclic_objects import CyclicObjects
from robotd_cia402.modes import OperationMode
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

    def put(self, word: int, mode: OperationMode, displayed: int, setpoint: Setpoint) -> None:
        """Put the values into the next frame, with controlword ``word``.

        A drive takes some frames to change its mode. While it has not ``displayed`` the profile
        position mode, it may still follow the target position as a cyclic setpoint.
        """
        scaling, position = self._scaling, setpoint.position
        counts = wrapped(scaling.counts(position)) if math.isfinite(position) else 0
        target, velocity, torque = counts, 0, 0
        if mode is OperationMode.PROFILE_POSITION:
            if displayed == mode:
                target = wrapped(setpoint.target_counts)
        elif mode is OperationMode.CYCLIC_VELOCITY:
            velocity = scaling.velocity_units(setpoint.velocity)
        elif mode is OperationMode.PROFILE_VELOCITY:
            velocity = scaling.velocity_units(setpoint.target_velocity)
        elif mode.is_torque:
            torque = scaling.torque_units(setpoint.torque)
        self._drive.put((word, mode, target, velocity, torque, counts))
        self.controlword = word
