"""The one place where a command to a single axis is refused.

Values are in the axis' SI units: rad or m, rad/s, rad/s². The texts carry the unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robotd.errors import InvalidArgument

LEAST = 1e-9  # of a speed or a ramp: what takes decades overflows in drives


@dataclass(frozen=True)
class AxisLimits:
    """What an axis may be asked for; inf (and -inf) where there is no limit.

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

    @classmethod
    def unlimited(cls) -> AxisLimits:
        """An axis of which nothing is known."""
        return cls(-math.inf, math.inf, math.inf, math.inf)


def check_move(
    limits: AxisLimits, target: float, velocity: float, acceleration: float, deceleration: float
) -> None:
    """Refuse a move that the axis must not make.

    Args:
        limits: of the axis.
        target: absolute; for a relative move, where it leads to.
        velocity, acceleration, deceleration: of the move, positive.

    Raises:
        InvalidArgument: naming the value and the limit, not the axis.
    """
    _check_finite("target", target)
    _check_positive("velocity", velocity)
    _check_speed_and_ramps(limits, velocity, acceleration, deceleration)
    if target > limits.upper:
        raise _beyond("target", target, "exceeds", limits.upper, limits.unit)
    if target < limits.lower:
        raise _beyond("target", target, "is below", limits.lower, limits.unit)


def check_jog(
    limits: AxisLimits, velocity: float, acceleration: float, deceleration: float
) -> None:
    """Refuse a velocity command beyond the limits; ``velocity`` is signed and may be 0.

    Raises:
        InvalidArgument: naming the value and the limit, not the axis.
    """
    _check_finite("velocity", velocity)
    _check_speed_and_ramps(limits, velocity, acceleration, deceleration)


def room_to_stop(
    limits: AxisLimits, position: float, velocity: float, deceleration: float
) -> float:
    """Distance that is left to a position limit after braking; negative where it is too late.

    Args:
        limits: of the axis.
        position, velocity: now; the limit is the one that ``velocity`` leads to.
        deceleration: of the stop, positive.
    """
    ahead = limits.upper - position if velocity > 0.0 else position - limits.lower
    return ahead - velocity * velocity / (2.0 * deceleration) if velocity else math.inf


def check_room(limits: AxisLimits, position: float, velocity: float, deceleration: float) -> None:
    """Refuse a velocity command that could not be stopped before a position limit.

    Raises:
        InvalidArgument: naming the values and the limit, not the axis.
    """
    if room_to_stop(limits, position, velocity, deceleration) < 0.0:
        limit, unit = (limits.upper if velocity > 0.0 else limits.lower), limits.unit
        raise InvalidArgument(
            f"from {position:.6g} {unit}, {velocity:.6g} {unit}/s cannot be stopped"
            f" before the limit {limit:.6g} {unit}"
        )


def _check_speed_and_ramps(
    limits: AxisLimits, velocity: float, acceleration: float, deceleration: float
) -> None:
    if abs(velocity) > limits.velocity:
        unit = f"{limits.unit}/s"
        raise _beyond("velocity", velocity, "exceeds", limits.velocity, unit)
    for name, ramp in (("acceleration", acceleration), ("deceleration", deceleration)):
        _check_positive(name, ramp)
        if ramp > limits.acceleration:
            unit = f"{limits.unit}/s²"
            raise _beyond(name, ramp, "exceeds", limits.acceleration, unit)


def _check_finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise InvalidArgument(f"{name} is {value}, must be a finite number")


def _check_positive(name: str, value: float) -> None:
    _check_finite(name, value)
    if value <= 0.0:
        raise InvalidArgument(f"{name} is {value:g}, must be positive")
    if value < LEAST:
        raise InvalidArgument(f"{name} is {value:g}, must be at least {LEAST:g}")


def _beyond(name: str, value: float, relation: str, limit: float, unit: str) -> InvalidArgument:
    return InvalidArgument(f"{name} {value:.6g} {unit} {relation} {limit:.6g} {unit}")
