"""Encoder counts ↔ user units, with gear ratios and polarity.

counts = units · polarity · numerator / denominator + offset, where the offset holds the home
position and, for an incremental encoder, where it woke up. Counts are those of a 64-bit
accumulator; the drive itself sends 32 bits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotd.api import FloatArray
from robotd_wmx_parameters import WmxParameters

_RANGE = 2.0**32


def wrap32(counts: FloatArray) -> FloatArray:
    """Wrap ``counts`` to a signed 32-bit register."""
    return (counts + _RANGE / 2) % _RANGE - _RANGE / 2


def gains(parameters: WmxParameters, axes: int) -> FloatArray:
    """Signed counts per user unit of the first ``axes`` axes."""
    numerator = parameters["AxisGearRatioNumerator"][:axes]
    denominator = parameters["AxisGearRatioDenominator"][:axes]
    return np.asarray(parameters["AxisPolarity"][:axes] * numerator / denominator, np.float64)


class Scaling:
    """Scale of n axes.

    Attributes:
        gain: signed counts per user unit.
        origin: counts that the encoder does not hold: at power-on of an incremental encoder,
            or the turns beyond the 32 bits of an absolute one. Whole numbers.
        home: counts between the encoder's zero and the home position. Whole numbers.
    """

    def __init__(self, gain: FloatArray) -> None:
        self.gain = gain.copy()
        self.origin: FloatArray = np.zeros_like(gain)
        self.home: FloatArray = np.zeros_like(gain)
        self._factors = _factors(self.gain)

    def counts(self, units: FloatArray) -> FloatArray:
        """Counts of a position, rounded, as a 64-bit accumulator that never lost its origin."""
        return np.rint(units * self.gain + self.origin + self.home)

    def quantised(self, units: Sequence[float]) -> list[float]:
        """``units`` as the encoders read them, in whole counts."""
        return [
            round(unit * gain) * inverse
            for unit, (gain, inverse) in zip(units, self._factors, strict=True)
        ]

    def change(
        self, gain: FloatArray, origin: FloatArray, home: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Take a new scale at unchanged encoder counts.

        Returns the factor and the summand by which every position changes its number.
        """
        moved = self.origin - origin + self.home - home
        scale = self.gain / gain
        self.gain, self.origin, self.home = gain.copy(), origin.copy(), home.copy()
        self._factors = _factors(self.gain)
        return scale, moved / self.gain


def _factors(gain: FloatArray) -> list[tuple[float, float]]:
    """Return counts per unit and units per count of each axis."""
    return list(zip(gain.tolist(), (1.0 / gain).tolist(), strict=True))
