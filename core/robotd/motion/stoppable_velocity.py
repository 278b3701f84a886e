"""Highest velocity from which a jerk-limited joint is at rest within a time."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray


def stoppable_velocity(acceleration: FloatArray, jerk: FloatArray, within_s: float) -> FloatArray:
    """Return the highest velocity (m,) of a motion that always stops ``within_s``.

    The worst moment is that of the highest acceleration a towards the velocity v: the stop takes
    a/j until the joint moves with v, and then what it takes from there. Below v = a²/j the
    acceleration limit is not reached, the highest one is sqrt(v·j), and both together take
    3·sqrt(v/j). Above it they take 2·a/j + v/a.

    Args:
        acceleration, jerk: (m,) limits, positive; in rad/s² and rad/s³, or m/s² and m/s³.
        within_s: not negative; 0 gives 0.
    """
    ramp_s = acceleration / jerk
    below = jerk * (within_s / 3.0) ** 2
    above = acceleration * (within_s - 2.0 * ramp_s)
    return np.where(within_s <= 3.0 * ramp_s, below, above)
