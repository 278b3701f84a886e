"""Conversion between SI units and the units of one drive, and plausible positions."""

from __future__ import annotations

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

    Attributes:
        counts_per_unit, polarity: set by ``change``.
        joint_velocity: as ``velocity_limit`` was given.
        position: rad or m for one count.
        velocity: rad/s or m/s for one velocity unit of the drive.
        torque: N·m for one per mille of the rated torque; NaN where that is not known.
    """

    def __init__(
        self,
        options: DriveOptions,
        rated_torque_nm: float | None,
        velocity_limit: float | None = None,
    ) -> None:
        self.rated_torque_nm = float("nan") if rated_torque_nm is None else rated_torque_nm
        self.joint_velocity = velocity_limit
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


class PositionPlausibility:
    """Rejects positions of one axis that it cannot have reached. Receive thread.

    The measured position becomes the command when the servo goes on or off: a corrupt one would be
    sent to the motor. So a position counts if it is near the one before, or near the rejected one
    before: then the drive has set its position. A new drive's first position is confirmed likewise.

    Args:
        scaling: of the axis; its ``velocity_limit`` bounds the distance.
        horizon_s: longest time between two accepted positions.
    """

    def __init__(self, scaling: Scaling, horizon_s: float) -> None:
        self._scaling, self._horizon_s = scaling, horizon_s
        self._last: int | None = None
        self._suspect: int | None = None

    def check(self, count: int, *, may_jump: bool) -> bool:
        """Return True for a position that counts; False: one near it has to come first.

        Raises ValueError for an implausible position, unless it ``may_jump``: of a new drive, or
        one that is homing.
        """
        if not (self._is_near(count, self._last) or self._is_near(count, self._suspect)):
            self._suspect = count
            if may_jump:
                return False
            step = wrapped(count - (self._last or 0)) * self._scaling.position
            raise ValueError(f"the position jumps by {step:.3g} rad (or m)")
        self._last = self._suspect = count
        return True

    def forget(self) -> None:
        """Forget the positions: those of a drive that is configured again may be others."""
        self._last = self._suspect = None

    def _is_near(self, count: int, before: int | None) -> bool:
        if before is None:
            return False
        scaling = self._scaling
        reach = scaling.counts_per_unit * scaling.velocity_limit * self._horizon_s
        return abs(wrapped(count - before)) <= reach
