"""Checks of a command to a single axis, against its limits.

Values are in the axis' SI units: rad or m, rad/s, rad/s². The texts carry the unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robotd.errors import InvalidArgument
from robotd.motion.profile import Profile
from robotd.motion.rejection import distinct

MEASURED_MARGIN = {"rad": 0.01, "m": 0.001}  # the default goal tolerances
MIN_RATE = 1e-9  # lower bound of speeds and ramps; smaller values overflow drive integers


@dataclass(frozen=True)
class AxisLimits:
    """Limits of the commands to one axis; inf (and -inf) where there is none.

    Attributes:
        lower, upper: position in ``unit``.
        velocity, acceleration: in ``unit``/s and ``unit``/s²; acceleration limits both ramps.
        unit: "rad" or "m".
    """

    lower: float
    upper: float
    velocity: float
    acceleration: float
    unit: str = "rad"

    def within(self, other: AxisLimits) -> AxisLimits:
        """Return the smaller of both limits, each value by itself.

        Raises ValueError: the units differ, or the position ranges have nothing in common.
        """
        if other.unit != self.unit:
            raise ValueError(f"limits in {self.unit} and in {other.unit} cannot be compared")
        lower, upper = max(self.lower, other.lower), min(self.upper, other.upper)
        if not lower < upper:
            raise ValueError(
                f"positions {self.lower:g} to {self.upper:g} {self.unit} and {other.lower:g} to"
                f" {other.upper:g} {self.unit} have no range in common"
            )
        return AxisLimits(
            lower,
            upper,
            min(self.velocity, other.velocity),
            min(self.acceleration, other.acceleration),
            self.unit,
        )

    def excess(self, position: float) -> str:
        """Return how a measured position is outside the limits; "" where it is not."""
        unit, (lowest, highest) = self.unit, self.measured
        if not (position < lowest or position > highest):  # NaN: not known
            return ""
        return (
            f"at {position:.4g} {unit}, outside its limits {self.lower:g} to {self.upper:g} {unit}"
        )

    @property
    def measured(self) -> tuple[float, float]:
        """Lowest and highest measured position that counts as inside."""
        margin = MEASURED_MARGIN[self.unit]
        return self.lower - margin, self.upper + margin

    @classmethod
    def unlimited(cls, unit: str = "rad") -> AxisLimits:
        """Return the limits of an axis of which nothing is known."""
        return cls(-math.inf, math.inf, math.inf, math.inf, unit)


def check_move(limits: AxisLimits, target: float, profile: Profile) -> None:
    """Reject a move that the axis must not make.

    Args:
        target: absolute; for a relative move, where it leads to.
        profile: of the move; all its values have to be positive.

    Raises InvalidArgument: naming the value and the limit, not the axis.
    """
    _check_finite("target", target)
    _check_positive("velocity", profile.velocity)
    _check_speed_and_ramps(limits, profile)
    if target > limits.upper:
        raise _beyond("target", target, "exceeds", limits.upper, limits.unit)
    if target < limits.lower:
        raise _beyond("target", target, "is below", limits.lower, limits.unit)


def check_jog(limits: AxisLimits, position: float, profile: Profile) -> None:
    """Reject a velocity command beyond the limits, or too late to stop before one.

    ``profile``: of the command; its velocity is signed and may be 0.
    Raises InvalidArgument: naming the values and the limit, not the axis.
    """
    velocity, unit = profile.velocity, limits.unit
    _check_finite("velocity", velocity)
    _check_speed_and_ramps(limits, profile)
    if not room_to_stop(limits, position, velocity, profile.deceleration) >= 0.0:  # also NaN
        begin, limit = distinct(position, limits.upper if velocity > 0.0 else limits.lower, 6)
        raise InvalidArgument(
            f"from {begin} {unit}, {velocity:.6g} {unit}/s cannot be stopped"
            f" before the limit {limit} {unit}"
        )


def room_to_stop(
    limits: AxisLimits, position: float, velocity: float, deceleration: float
) -> float:
    """Return the distance to a position limit after braking; negative: it is too late to brake.

    NaN where there is a limit and a value is not known.

    Args:
        position, velocity: now; the limit is the one that ``velocity`` leads to.
        deceleration: of the stop, positive.
    """
    limit = limits.upper if velocity > 0.0 else limits.lower
    if not velocity or math.isinf(limit):
        return math.inf
    ahead = limit - position if velocity > 0.0 else position - limit
    return ahead - velocity * velocity / (2.0 * deceleration)


def _check_speed_and_ramps(limits: AxisLimits, profile: Profile) -> None:
    if abs(profile.velocity) > limits.velocity:
        unit = f"{limits.unit}/s"
        raise _beyond("velocity", profile.velocity, "exceeds", limits.velocity, unit)
    for name in ("acceleration", "deceleration"):
        ramp = getattr(profile, name)
        _check_positive(name, ramp)
        if ramp > limits.acceleration:
            raise _beyond(name, ramp, "exceeds", limits.acceleration, f"{limits.unit}/s²")


def _check_finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise InvalidArgument(f"{name} is {value}, must be a finite number")


def _check_positive(name: str, value: float) -> None:
    _check_finite(name, value)
    if value <= 0.0:
        raise InvalidArgument(f"{name} is {value:g}, must be positive")
    if value < MIN_RATE:
        raise InvalidArgument(f"{name} is {value:g}, must be at least {MIN_RATE:g}")


def _beyond(name: str, value: float, relation: str, limit: float, unit: str) -> InvalidArgument:
    given, bound = distinct(value, limit, 6)
    return InvalidArgument(f"{name} {given} {unit} {relation} {bound} {unit}")
