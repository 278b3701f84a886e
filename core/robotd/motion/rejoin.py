"""Back to a path that goes on: how an offset from it, and its rate, fade away."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.joints import JointLimits

SHORTEST_S = 0.02
VELOCITY_SHARE = 0.1  # of a joint's velocity limit that the way back may add
# Largest values of the quintic with zero acceleration at both ends and zero velocity at the last:
# an offset p that fades within T moves at 15/8 p/T and accelerates by 10/√3 p/T²; a rate v, by
# less than 3.95 v/T.
PEAK_VELOCITY, PEAK_ACCELERATION, PEAK_OF_RATE = 1.875, 5.774, 3.95


class Rejoin:
    """An offset that begins as given and ends at rest at zero; velocity is continuous.

    It takes so long that it adds about as much acceleration as the joints may have, and a tenth
    of their velocity.

    Args:
        offset: (2, m) positions and velocities, off the path.
        limits: of the joints.

    Attributes:
        duration_s: after that the offset is zero.
    """

    def __init__(self, offset: FloatArray, limits: JointLimits) -> None:
        position, velocity = offset
        distance, speed = np.abs(offset)
        self.duration_s = max(
            SHORTEST_S,
            float((PEAK_OF_RATE * speed / limits.acceleration).max()),
            float(np.sqrt(PEAK_ACCELERATION * distance / limits.acceleration).max()),
            float((PEAK_VELOCITY * distance / (VELOCITY_SHARE * limits.velocity)).max()),
        )
        rate = velocity * self.duration_s
        # In s = t/T: p + v·s - (10p + 6v)·s³ + (15p + 8v)·s⁴ - (6p + 3v)·s⁵
        self._coefficients = np.array([
            position, rate, np.zeros_like(rate), -(10 * position + 6 * rate),
            15 * position + 8 * rate, -(6 * position + 3 * rate),
        ])  # fmt: skip

    def at(self, time_s: float) -> FloatArray:
        """(2, m) positions and velocities off the path, ``time_s`` after the beginning."""
        if time_s >= self.duration_s:
            return np.zeros((2, self._coefficients.shape[1]))
        share = max(time_s, 0.0) / self.duration_s
        powers = share ** np.arange(6)
        rates = np.arange(1, 6) * powers[:5] / self.duration_s
        return np.stack([powers @ self._coefficients, rates @ self._coefficients[1:]])
