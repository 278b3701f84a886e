"""Steering angle and speed of a steered base within the limits of both axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robotd.motion.planar import PlanarTwist
from robotd.motion.wheels import STRAIGHT_M_S, SteeredWheels

ARRIVED_RAD = 1e-9
WAIT_RAD = 0.3  # missing part of the angle at which the driven wheel stands


@dataclass(frozen=True)
class SteeringLimits:
    """Limits of the steering axis and of the driven wheel.

    Attributes:
        velocity: of steering, rad/s.
        acceleration: of steering, rad/s².
        wheel_acceleration: of the driven wheel, rad/s².
    """

    velocity: float
    acceleration: float
    wheel_acceleration: float


class SteeringFollower:
    """Follows twists with angle and speed, one step a period. One thread.

    The driven wheel waits for the steering: the more of the angle is missing, the slower it turns,
    so that the base leaves the commanded arc as little as possible. At a standstill the angle
    stays.

    Args:
        wheels: kinematics of the base.
        limits: of both axes.
        angle: at the begin, rad; the wheel is at rest.
        period_s: of the control loop.

    Attributes:
        angle, rate: of steering, rad and rad/s.
        speed: of the driven wheel, rad/s.
    """

    def __init__(
        self, wheels: SteeredWheels, limits: SteeringLimits, angle: float, period_s: float
    ) -> None:
        self.angle, self.rate, self.speed = angle, 0.0, 0.0
        self._wheels, self._limits, self._period_s = wheels, limits, period_s
        self._target = angle

    @property
    def at_rest(self) -> bool:
        """Nothing turns."""
        return self.speed == 0.0 and self.rate == 0.0

    @property
    def twist(self) -> PlanarTwist:
        """Twist of the base at this angle and speed."""
        return self._wheels.twist(self.speed, self.angle)

    def step(self, twist: PlanarTwist) -> None:
        """Move on by one period towards ``twist``."""
        speed, target = self._wheels.speeds(twist)
        across = self._wheels.wheelbase * twist.angular
        if math.hypot(twist.linear, across) >= STRAIGHT_M_S:
            self._target = target
        self._steer()
        wanted = speed * max(0.0, 1.0 - abs(self._target - self.angle) / WAIT_RAD)
        step = self._limits.wheel_acceleration * self._period_s
        self.speed += max(-step, min(step, wanted - self.speed))

    def _steer(self) -> None:
        """Turn towards the target, as fast as the axis can still stop there."""
        limits, period_s = self._limits, self._period_s
        missing = self._target - self.angle
        step = limits.acceleration * period_s
        stopping = (math.sqrt(step * step + 8.0 * limits.acceleration * abs(missing)) - step) / 2
        wanted = math.copysign(min(limits.velocity, stopping, abs(missing) / period_s), missing)
        before = self.rate
        self.rate += max(-step, min(step, wanted - before))
        self.angle += self.rate * period_s
        if abs(self._target - self.angle) < ARRIVED_RAD and abs(before) <= step:
            self.angle, self.rate = self._target, 0.0
