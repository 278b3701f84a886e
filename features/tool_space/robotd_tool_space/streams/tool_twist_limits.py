"""Limits of a streamed tool motion, and the ramp that keeps them."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from ruckig import (
    ControlInterface,
    InputParameter,
    Ruckig,
    RuckigError,
    Synchronization,
    Trajectory,
)

from robotd.api import FloatArray, InvalidArgument

MIN_ACCELERATION = 1e-3  # m/s² or rad/s²: limit of a component that does not change
HARDER = 1.05  # times the planned acceleration of a stop, from which it is planned again
STRONGEST_SHARES = 1.0, 1.001, 1.01  # of the change of a rate, until a plan is found


@dataclass(frozen=True)
class ToolTwistLimits:
    """Limits of the tool's motion in a stream; all positive.

    Attributes:
        linear_m_s, angular_rad_s: speeds.
        linear_m_s2, angular_rad_s2: accelerations, reached in ``rise_s``.
        rise_s: time from no acceleration to the highest.
    """

    linear_m_s: float = 0.5
    angular_rad_s: float = 1.0
    linear_m_s2: float = 1.5
    angular_rad_s2: float = 4.0
    rise_s: float = 0.08

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise InvalidArgument(f"{name} is {value}, must be a positive number")

    def slowed(self, twist: FloatArray) -> FloatArray:
        """Return ``twist`` (6,), m/s and rad/s, with its direction and within the speeds."""
        linear, angular = float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:]))
        excess = max(linear / self.linear_m_s, angular / self.angular_rad_s, 1.0)
        slowed: FloatArray = twist / excess
        return slowed


class RampState(NamedTuple):
    """State from which a ``TwistRamp`` can go on; immutable.

    Attributes:
        twist, acceleration: as those of the ramp.
        target: that it leads to.
        plan, seconds: change to the target, and the time that has passed on it.
    """

    twist: FloatArray
    acceleration: FloatArray
    target: FloatArray
    plan: Trajectory
    seconds: float


class TwistRamp:
    """Twist that follows its target with limited acceleration and jerk, on a straight line.

    The six components change in the same proportion, so that a motion from rest keeps the direction
    of its target. One thread; arrays (6,), m/s and rad/s.

    Args:
        period_s: time between two calls of ``advance``.

    Attributes:
        twist, acceleration: at the end of the last period.
    """

    def __init__(self, limits: ToolTwistLimits, period_s: float) -> None:
        self._period_s = period_s
        self._limits = limits
        self._ruckig, self._input = Ruckig(6), InputParameter(6)
        self._input.control_interface = ControlInterface.Velocity
        self._input.synchronization = Synchronization.Phase
        self._set(np.zeros(6), np.zeros(6))

    @property
    def at_rest(self) -> bool:
        """The twist is 0 and stays so."""
        return not (self.twist.any() or self._target.any())

    @property
    def target(self) -> FloatArray:
        """Twist that it leads to."""
        return self._target

    def go(self, target: FloatArray, strongest: float = math.inf) -> None:
        """Change to ``target`` from the next period on.

        Args:
            target: (6,).
            strongest: highest share of the whole change in a second, 1/s.
        """
        if not np.array_equal(target, self._target):
            self._begin(target, strongest)

    def stop_harder(self, strongest: float) -> None:
        """Slow to rest with a higher share of the twist in a second, 1/s, than planned, if it is.

        The target is rest already.
        """
        if self._seconds >= self._plan.duration:
            return
        share = min(strongest, self._hardest(-self.twist))
        planned = np.asarray(self._input.max_acceleration)
        if (share * np.abs(self.twist) > HARDER * planned).any():
            self._begin(self._target, strongest)

    def stop_displacement(self, strongest: float) -> FloatArray:
        """Return the displacement (6,), m and rad, of a stop now; ``strongest`` as in ``go``."""
        stop = self._plan_to(np.zeros(6), strongest)
        displacement, _, _ = stop.at_time(stop.duration)
        return np.array(displacement)

    @property
    def state(self) -> RampState:
        """All that ``resume`` needs to go on from here."""
        return RampState(self.twist, self.acceleration, self._target, self._plan, self._seconds)

    def resume(self, state: RampState) -> None:
        """Go on from a state before, as if nothing had changed since."""
        self.twist, self.acceleration, self._target, self._plan, self._seconds = state

    def turn(self, twist: FloatArray, acceleration: FloatArray) -> None:
        """Go on with ``twist`` and ``acceleration`` instead of the last ones."""
        self._set(twist, acceleration)

    def advance(self) -> FloatArray:
        """Return the twist at the end of the next period."""
        if self._seconds <= self._plan.duration:
            self._seconds += self._period_s
            _, velocity, acceleration = self._plan.at_time(self._seconds)
            self.twist, self.acceleration = np.array(velocity), np.array(acceleration)
            if self._seconds >= self._plan.duration:
                self.twist, self.acceleration = self._target.copy(), np.zeros(6)
        return self.twist

    def _set(self, twist: FloatArray, acceleration: FloatArray) -> None:
        self.twist, self.acceleration = twist.copy(), acceleration.copy()
        self._begin(self.twist, math.inf)

    def _begin(self, target: FloatArray, strongest: float) -> None:
        self._target = np.array(target, np.float64)
        self._plan, self._seconds = self._plan_to(self._target, strongest), 0.0

    def _plan_to(self, target: FloatArray, strongest: float) -> Trajectory:
        limits, change = self._limits, target - self.twist
        share = min(strongest, self._hardest(change))
        highest = np.maximum(share * np.abs(change), np.abs(self.acceleration)) + MIN_ACCELERATION
        self._input.max_acceleration = highest.tolist()
        self._input.max_jerk = (highest / limits.rise_s).tolist()
        self._input.current_velocity = self.twist.tolist()
        self._input.current_acceleration = self.acceleration.tolist()
        self._input.target_velocity = target.tolist()
        plan = Trajectory(6)
        self._ruckig.calculate(self._input, plan)
        return plan

    def _hardest(self, change: FloatArray) -> float:
        """Return the share of a change in a second that the tool's accelerations allow, 1/s."""
        linear, angular = np.linalg.norm(change[:3]), np.linalg.norm(change[3:])
        return min(
            self._limits.linear_m_s2 / max(float(linear), 1e-9),
            self._limits.angular_rad_s2 / max(float(angular), 1e-9),
        )


class FactorRamp:
    """Factor that follows a moving limit with limited first and second derivatives.

    The deviation from the limit goes to 0 in minimal time; from then on the factor is the limit.
    One thread.

    Args:
        period_s: time between two calls of ``advance``.

    Attributes:
        factor, rate: at the end of the last period; 1/s.
    """

    def __init__(self, period_s: float) -> None:
        self.factor, self.rate = 1.0, 0.0
        self._limit, self._period_s = 1.0, period_s
        self._ruckig, self._input, self._plan = Ruckig(1), InputParameter(1), Trajectory(1)
        self._input.target_position = self._input.target_velocity = [0.0]

    def set(self, factor: float) -> None:
        """Begin anew at ``factor``, which is its own limit."""
        self.factor = self._limit = factor
        self.rate = 0.0

    def advance(self, limit: float, lowest: float, highest: float, strongest: float) -> float:
        """Return the factor at the end of the next period.

        Args:
            limit: highest factor, at the end of that period.
            lowest, highest: range of its rate, 1/s; around 0.
            strongest: highest change of the rate, 1/s².
        """
        slope = (limit - self._limit) / self._period_s
        slope = min(max(slope, 0.9 * lowest), 0.9 * highest)
        before = limit - slope * self._period_s
        self._limit = limit
        parameters = self._input
        parameters.current_position = [self.factor - before]
        parameters.current_velocity = [self.rate - slope]
        parameters.min_velocity, parameters.max_velocity = [lowest - slope], [highest - slope]
        self._calculate(strongest)
        (deviation,), (rate,), _ = self._plan.at_time(self._period_s)
        self.factor, self.rate = limit + deviation, slope + rate
        return self.factor

    def _calculate(self, strongest: float) -> None:
        """Plan the change to the limit. Raises RuckigError: none was found."""
        # While it brakes it is exactly as far away as its brakes need, where rounding decides: once
        # in about 50 000 periods ruckig finds no plan for that.
        for share in STRONGEST_SHARES[:-1]:
            self._input.max_acceleration = [share * strongest]
            with suppress(RuckigError):
                self._ruckig.calculate(self._input, self._plan)
                return
        self._input.max_acceleration = [STRONGEST_SHARES[-1] * strongest]
        self._ruckig.calculate(self._input, self._plan)
