"""Extremes of position, velocity and acceleration of a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray
from robotd.motion.extremes import Extreme, derivative, extremes


@dataclass(frozen=True, eq=False)
class PathPeaks:
    """Extremes of a path per joint, with their times; exact to 1e-9, SI units.

    Attributes:
        lowest, highest: positions.
        velocity, acceleration: largest magnitudes.
    """

    lowest: Extreme
    highest: Extreme
    velocity: Extreme
    acceleration: Extreme

    @classmethod
    def of(cls, breaks: FloatArray, coefficients: FloatArray) -> PathPeaks:
        """Find the extremes of ``coefficients`` (k, order, m) over ``breaks`` (k + 1,)."""
        velocity = derivative(coefficients)
        lowest, highest = extremes(breaks, coefficients)
        return cls(
            lowest,
            highest,
            _magnitude(breaks, velocity),
            _magnitude(breaks, derivative(velocity)),
        )


def _magnitude(breaks: FloatArray, coefficients: FloatArray) -> Extreme:
    lowest, highest = extremes(breaks, coefficients)
    positive = highest.value >= -lowest.value
    return Extreme(
        np.where(positive, highest.value, -lowest.value),
        np.where(positive, highest.time_s, lowest.time_s),
    )
