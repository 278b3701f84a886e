"""Return of the command to joints that did not follow it, against jumps when freed."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.motion import JointLimits

MIN_ERROR = 0.005  # rad or m; less is lag and sag of a healthy drive, and stays
PEAK_VELOCITY, PEAK_ACCELERATION = 1.875, 5.7735  # of 10u³ - 15u⁴ + 6u⁵, for 1 in 1 s


class CommandReturn:
    """Move of the command alone, from standstill to standstill, within the joints' limits.

    The joint rests at its measured position; the command moves there along a quintic polynomial.

    Args:
        command: (m,) position command, rad or m.
        offset: (m,) from the command to the joints at rest, rad or m.

    Attributes:
        start_ns: when it begins; later after a pause.
        duration_s: of the move.
    """

    def __init__(
        self, command: FloatArray, offset: FloatArray, limits: JointLimits, start_ns: int
    ) -> None:
        self.start_ns = start_ns
        self._ended = False
        self._start = command.copy()
        self._offset: FloatArray = np.where(np.abs(offset) > MIN_ERROR, offset, 0.0)
        size = np.abs(self._offset)
        by_velocity = PEAK_VELOCITY * size / limits.velocity
        by_acceleration = np.sqrt(PEAK_ACCELERATION * size / limits.acceleration)
        self.duration_s = float(np.maximum(by_velocity, by_acceleration).max())

    def points(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return times (count,) in s from 0, and positions (count, m) of the command."""
        u = np.linspace(0.0, 1.0, count)
        way = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        return u * self.duration_s, self._start + way[:, None] * self._offset

    def sample(self, time_ns: int, command: FloatArray) -> bool:
        """Write the motion at ``time_ns`` into ``command`` (3, m).

        Returns False when the end had been written before.
        """
        if self._ended:
            return False
        time_s = (time_ns - self.start_ns) / NANOSECONDS
        u = min(time_s / self.duration_s, 1.0) if self.duration_s else 1.0
        command[0] = self._start + self._offset * (u**3 * (10.0 - 15.0 * u + 6.0 * u**2))
        rate = 1.0 / self.duration_s if self.duration_s else 0.0
        command[1] = self._offset * (30.0 * u**2 * (1.0 - u) ** 2 * rate)
        command[2] = self._offset * (60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * rate**2)
        self._ended = u >= 1.0
        return True
