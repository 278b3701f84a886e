"""Bounds of the rate of a trajectory, for accelerations of bodies that the joints move."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robotd.arrays import FloatArray

LEAST_SHARE = 0.02  # of an acceleration limit, where the path uses all of it by itself


@dataclass(frozen=True, eq=False)
class RateBounds:
    """Bounds of the change of a trajectory's rate, such as for the tool of an arm. Immutable.

    At rate r = ds/dt a body with velocity v and acceleration a at rate 1 accelerates with
    a·r² + v·dr/dt. It is within its limit.

    Attributes:
        step_s: between samples; the first is at trajectory time 0.
        speeds: (k, p) of p bodies at rate 1, of any unit; the translation of a tool and its turn.
        tangential, normal: (k, p) parts of their accelerations along their velocities, and at right
            angles to them.
        limits: (p,) of the accelerations.
    """

    step_s: float
    speeds: FloatArray
    tangential: FloatArray
    normal: FloatArray
    limits: FloatArray

    def slopes(self, time_s: float, rate: float) -> tuple[float, float]:
        """Return how fast the rate may fall and rise at trajectory time ``time_s``, 1/s."""
        row = min(max(int(time_s / self.step_s + 0.5), 0), len(self.speeds) - 1)
        fall = rise = math.inf
        squared = rate * rate
        for speed, tangential, normal, limit in zip(
            self.speeds[row].tolist(),
            self.tangential[row].tolist(),
            self.normal[row].tolist(),
            self.limits.tolist(),
            strict=True,
        ):
            if speed > 0.0:
                room = math.sqrt(max(limit**2 - (normal * squared) ** 2, 0.0))
                least = LEAST_SHARE * limit
                fall = min(fall, max(room + tangential * squared, least) / speed)
                rise = min(rise, max(room - tangential * squared, least) / speed)
        return fall, rise
