"""Conversion between SI units and the units of one drive."""

from __future__ import annotations

import math

from robotd_cia402.options import DriveOptions

SPAN = 1 << 32
_HALF = SPAN >> 1
_INT16 = (1 << 15) - 1
_INT32 = _HALF - 1
_UNLIMITED = 100.0  # rad/s or m/s, for an axis without a velocity limit in the descriptor


class Scaling:
    """Counts and units of one axis; changed by a worker while the servo is off.

    Args:
        rated_torque_nm: None where it is not known.
        velocity_limit: rad/s or m/s; None for an axis that is no joint.
        position_limits: lowest and highest in rad or m; infinite where there is none.

    Attributes:
        counts_per_unit, polarity: set by ``change``.
        joint_velocity: as ``velocity_limit`` was given.
        position_limits: as given.
        position: rad or m for one count.
        velocity: rad/s or m/s for one velocity unit of the drive.
        torque: N·m for one per mille of the rated torque; NaN where that is not known.
    """

    def __init__(
        self,
        options: DriveOptions,
        rated_torque_nm: float | None,
        velocity_limit: float | None = None,
        position_limits: tuple[float, float] = (-math.inf, math.inf),
    ) -> None:
        self.rated_torque_nm = float("nan") if rated_torque_nm is None else rated_torque_nm
        self.joint_velocity = velocity_limit
        self.position_limits = position_limits
        self.velocity_limit = velocity_limit or _UNLIMITED
        self._velocity = options.velocity_per_rad_s
        self._acceleration = options.acceleration_per_rad_s2
        self.change(options.counts_per_rad, options.polarity)

    def change(self, counts_per_unit: float, polarity: int) -> None:
        """Worker: set the scale, and the factors that follow from it."""
        self.counts_per_unit, self.polarity = counts_per_unit, polarity
        self.position = polarity / counts_per_unit
        self.velocity = polarity / (self._velocity or counts_per_unit)
        self.torque = polarity * self.rated_torque_nm / 1000

    def counts(self, position: float) -> int:
        """Counts of a position, not wrapped."""
        return round(position / self.position)

    def velocity_units(self, velocity: float) -> int:
        """Velocity units of the drive, within 32 bits: a faster command would reverse."""
        return max(-_INT32, min(_INT32, round(velocity / self.velocity)))

    def torque_units(self, torque: float) -> int:
        """Per mille of the rated torque, which is known; within 16 bits."""
        return max(-_INT16, min(_INT16, round(torque / self.torque)))

    def ramp_units(self, acceleration: float) -> int:
        """Acceleration units of a positive acceleration, at least 1."""
        units = acceleration * (self._acceleration or self.counts_per_unit)
        return max(1, min(SPAN - 1, round(units)))


def wrapped(counts: int) -> int:
    """Wrap counts to 32 signed bits: an endless axis runs over."""
    return (counts + _HALF) % SPAN - _HALF
