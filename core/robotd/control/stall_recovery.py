"""The way back to the path after the cycle has stood still."""

from __future__ import annotations

import math

import numpy as np

from robotd.arrays import BoolArray, FloatArray

_SPEED_FADES_S = 0.005  # time constants
_OFFSET_FADES_S = 0.05
_SHARE = 0.1  # of a joint's velocity limit, for the way back
_LONGEST_S = 0.5
_NEGLIGIBLE = 1e-6  # rad or m


class StallRecovery:
    """A deviation from the path that fades out, so that no joint leaps after a pause.

    While setpoints are missing a drive goes on with the velocity of the last one, or stands. There,
    and with that velocity, the setpoints begin again; from then on the velocity is soon the path's,
    and the deviation goes at no more than a tenth of the joint's velocity limit. That part of the
    motion is not in the velocity of a setpoint: the next pause must not carry it on.

    All follows from setpoints. What a drive reports is as late as the cycle is, and to start from
    there feeds on itself under pause upon pause.

    Args:
        reached: (2, m) position and velocity of the commands at the end of the pause.
        path: (2, m) the same of the path.
        velocity_limit: (m,) of the joints.

    Attributes:
        offset: (m,) from the path, rad or m.
    """

    def __init__(self, reached: FloatArray, path: FloatArray, velocity_limit: FloatArray) -> None:
        self.offset, self._speed = reached - path
        self._fastest = _SHARE * velocity_limit

    @property
    def is_far(self) -> BoolArray:
        """(m,) bool: joints that cannot be led back within half a second."""
        far: BoolArray = np.abs(self.offset) > _LONGEST_S * self._fastest
        return far

    def lay_over(self, setpoint: FloatArray) -> None:
        """Add the deviation to ``setpoint`` (2, m), which is the path's. Cycle."""
        setpoint[0] += self.offset
        setpoint[1] += self._speed

    def fade(self, period_s: float) -> bool:
        """One period on; False when nothing is left. Cycle."""
        self._speed *= math.exp(-period_s / _SPEED_FADES_S)
        back = np.clip(self.offset / _OFFSET_FADES_S, -self._fastest, self._fastest)
        self.offset += (self._speed - back) * period_s
        return bool(np.abs(self.offset).max() > _NEGLIGIBLE)
