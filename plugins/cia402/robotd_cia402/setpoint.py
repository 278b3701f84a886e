"""Setpoint of one axis: the position and velocity that the next frame carries."""

from __future__ import annotations

import math


class Setpoint:
    """Commanded motion, rad (or m) and seconds.

    Workers set targets and ramps while no motion is under way; the control loop follows them.

    Attributes:
        position, velocity: setpoint of the next frame; NaN before the first report of the drive.
        waits: a streamed setpoint has not been sent yet.
        target_velocity: velocity to reach along the ramps.
        target_counts: target of a profile position move, not wrapped.
        torque: setpoint of the cyclic torque mode, N·m or N.
        acceleration, deceleration: ramps of the velocity; the latter also of the running stop.
    """

    def __init__(self, ramp: float) -> None:
        self.position, self.velocity = math.nan, 0.0
        self.waits = False
        self.target_velocity = self.torque = 0.0
        self.target_counts = 0
        self.acceleration = self.deceleration = ramp

    def stand_at(self, position: float) -> None:
        """Stand at ``position``, without a velocity to reach."""
        self.position, self.velocity, self.target_velocity = position, 0.0, 0.0

    def follow(self, position: float, velocity: float, *, by_velocity: bool) -> None:
        """Control loop: a streamed setpoint; ``by_velocity``: its position does not count."""
        self.velocity, self.waits = velocity, True
        if by_velocity:
            self.target_velocity = velocity
        else:
            self.position = position

    def brake(self, period_s: float) -> None:
        """Control loop: one period of a stop in a cyclic position mode."""
        self.velocity = _towards(self.velocity, 0.0, self.deceleration * period_s)
        self.position += self.velocity * period_s

    def ramp(self, period_s: float) -> None:
        """Control loop: one period towards ``target_velocity``."""
        slower = abs(self.target_velocity) < abs(self.velocity)
        rate = self.deceleration if slower else self.acceleration
        self.velocity = _towards(self.velocity, self.target_velocity, rate * period_s)


def _towards(value: float, target: float, step: float) -> float:
    return min(target, value + step) if value < target else max(target, value - step)
