"""Rate at which a trajectory's own time passes, ramped towards the speed of the operator.

With trajectory time s and rate r = ds/dt the joints move with q'(s)·r and accelerate with
q''(s)·r² + q'(s)·dr/dt. No joint leaves its path.
"""

from __future__ import annotations

import math

import numpy as np

from robotd.arrays import FloatArray
from robotd.device.motion_limits import MotionLimits
from robotd.device.speed_scale import SpeedScale
from robotd.motion import JointLimits, Trajectory

MAX_SLOPE = 2.0  # 1/s, for the operator: 100 % to standstill in half a second, limits permitting
MIN_SHARE = 0.2  # of an acceleration limit, for a path that uses all of it by itself
MIN_SPEED = 1e-9  # rad/s; slower joints count as standing
BRAKE_SHARE = 0.5  # of the accelerations, to slow down before a faster part of the path
MIN_BRAKE, MAX_BRAKE = 0.5, 10.0  # 1/s
SAMPLES = 9  # of the path ahead; densest at its beginning


class PathRate:
    """Rate of one trajectory. Control loop; ``value`` may be read by any thread.

    Until the trajectory has begun to move, it is the speed in force, without a ramp. Under a limit
    of the group's speed it looks ahead as far as it takes to slow down from rate 1: r² changes by
    2·D with trajectory time, where D is the change of r in real time.

    ``limits``: of the joints; their accelerations count.

    Attributes:
        path: (2, m) velocity and acceleration of the path at rate 1, at the last setpoint.
        value: at the end of the last period.
        slope: its mean change in the last period, 1/s.
        override: part of the speed that this trajectory is to have; any thread may write it.
    """

    def __init__(
        self,
        speed: SpeedScale,
        motion_limits: MotionLimits,
        trajectory: Trajectory,
        limits: JointLimits,
    ) -> None:
        self.path: FloatArray = np.zeros((2, len(limits.names)))
        self.value, self.slope, self.override = speed.scale, 0.0, 1.0
        self._speed, self._limit = speed, limits.acceleration
        self._motion_limits, self._trajectory = motion_limits, trajectory
        slope = BRAKE_SHARE * float((limits.acceleration / limits.velocity).min())
        slope = min(max(slope, MIN_BRAKE), MAX_BRAKE)
        self._ahead_s = np.linspace(0.0, 1.0, SAMPLES) ** 2 / (2.0 * slope)
        self._gain = 2.0 * slope * self._ahead_s
        self._highest = math.inf
        self._max_slope = MAX_SLOPE
        self._waits = True  # nothing has moved yet

    @property
    def is_full(self) -> bool:
        """Trajectory time passes as real time does, and is to go on so."""
        steady = self.value == 1.0 and self.slope == 0.0
        full = self._wanted == 1.0 and self._motion_limits.factors is None
        return steady and full and not self._waits

    def wait(self) -> None:
        """Take the speed in force: the trajectory waits for its start."""
        if self._waits:
            self.value = self._target

    def take_over(self, rate: float) -> None:
        """Continue from the ``rate`` of a trajectory in motion."""
        self.value, self._waits = rate, False
        _, velocity, acceleration = self._trajectory.evaluate(np.zeros(1))
        self.path[:] = velocity[0], acceleration[0]

    def stand(self) -> None:
        """Begin anew from standstill: the device held its position during a stall."""
        self.value, self._max_slope = 0.0, math.inf

    def step(self, elapsed_s: float, time_s: float) -> float:
        """Ramp for ``elapsed_s``, the real time since the last setpoint; return the mean rate.

        ``time_s`` is the trajectory time of that setpoint.
        """
        self._highest = self._highest_at(time_s + elapsed_s * self.value)
        self.wait()
        before, target = self.value, self._target
        largest = 0.0
        if target != before:
            largest = elapsed_s * self._largest_slope(
                math.inf if self._highest < before else self._max_slope
            )
        change = min(max(target - before, -largest), largest)
        if change == target - before:
            self.value, self._max_slope = target, MAX_SLOPE
        else:
            self.value = before + change
        self._waits = self._waits and target == 0.0
        self.slope = (self.value - before) / elapsed_s
        return 0.5 * (before + self.value)

    def _highest_at(self, time_s: float) -> float:
        """Return the highest rate at trajectory time ``time_s`` under the group's limit."""
        factors = self._motion_limits.factors
        if factors is None:
            return math.inf
        position, velocity, _ = self._trajectory.evaluate(time_s + self._ahead_s)
        return math.sqrt(float((factors(position, velocity) ** 2 + self._gain).min()))

    @property
    def _wanted(self) -> float:
        return self._speed.scale * self.override

    @property
    def _target(self) -> float:
        return min(self._wanted, self._highest)

    def _largest_slope(self, highest: float) -> float:
        velocity, acceleration = self.path
        spare = self._limit - np.abs(acceleration) * self.value**2
        allowed = np.maximum(spare, MIN_SHARE * self._limit)
        speed = np.maximum(np.abs(velocity), MIN_SPEED)
        return min(float((allowed / speed).min()), highest)


def scale(setpoint: FloatArray, rate: float, slope: float) -> None:
    """Turn the path's position, velocity and acceleration (3, m) into those in real time.

    Args:
        setpoint: of the path at rate 1; changed in place.
        rate: r.
        slope: dr/dt, 1/s.
    """
    _, velocity, acceleration = setpoint
    acceleration *= rate**2
    acceleration += velocity * slope
    velocity *= rate
