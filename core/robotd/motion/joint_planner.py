"""Time-optimal, jerk-limited plans of independent joints, by ruckig."""

from __future__ import annotations

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

from robotd.arrays import BoolArray, FloatArray

# Some boundary cases, such as a way on which the speed limit is just reached, have no solution in
# floating-point arithmetic; beside them there is one.
JERK_SHARES = (1.0, 0.999, 0.99, 0.9)
_INTERFACES = (ControlInterface.Position, ControlInterface.Velocity)  # to a position, anywhere


class Bounds(NamedTuple):
    """Limits of one plan; each (m,), lowest ≤ 0 ≤ highest, SI units."""

    lowest_velocity: FloatArray
    highest_velocity: FloatArray
    lowest_acceleration: FloatArray
    highest_acceleration: FloatArray
    jerk: FloatArray

    @classmethod
    def symmetric(cls, velocity: FloatArray, acceleration: FloatArray, jerk: FloatArray) -> Bounds:
        """Return the same limits in both directions."""
        return cls(-velocity, velocity, -acceleration, acceleration, jerk)


class JointPlanner:
    """One plan for m joints, none of which waits for another. One thread."""

    def __init__(self, joints: int) -> None:
        self._ruckig = Ruckig(joints)
        self._input = InputParameter(joints)
        self._input.synchronization = Synchronization.No
        self._input.target_acceleration = [0.0] * joints
        self._trajectory = Trajectory(joints)
        self._anywhere = [False] * joints
        self._bounds: Bounds | None = None

    def plan(
        self, state: FloatArray, target: FloatArray, velocity: FloatArray, bounds: Bounds
    ) -> bool:
        """Plan from ``state`` (3, m) to each joint's target, without acceleration.

        Args:
            state: position, velocity and acceleration.
            target: (m,) positions; NaN: anywhere, at ``velocity``.
            velocity: (m,) at the target; afterwards the joint continues with it.
            bounds: of the way.

        Returns:
            False when ruckig finds no plan; ``at`` is then undefined.
        """
        parameters = self._input
        position = target.tolist()
        anywhere = [each != each for each in position]  # noqa: PLR0124 - NaN
        if anywhere != self._anywhere:
            self._anywhere = anywhere
            parameters.per_dof_control_interface = [_INTERFACES[each] for each in anywhere]
        if True in anywhere:
            position = [0.0 if each != each else each for each in position]  # noqa: PLR0124
        parameters.current_position, parameters.current_velocity, acceleration = state.tolist()
        parameters.current_acceleration = acceleration
        parameters.target_position = position
        parameters.target_velocity = velocity.tolist()
        self._limit(bounds)
        return any(self._calculate(bounds.jerk * share) for share in JERK_SHARES)

    def _limit(self, bounds: Bounds) -> None:
        """Set the limits of the way, if they are not those of the plan before."""
        if bounds is self._bounds:
            return
        self._bounds, parameters = bounds, self._input
        parameters.min_velocity = bounds.lowest_velocity.tolist()
        parameters.max_velocity = bounds.highest_velocity.tolist()
        parameters.min_acceleration = bounds.lowest_acceleration.tolist()
        parameters.max_acceleration = bounds.highest_acceleration.tolist()

    def _calculate(self, jerk: FloatArray) -> bool:
        self._input.max_jerk = jerk.tolist()
        try:
            self._ruckig.calculate(self._input, self._trajectory)
        except (RuckigError, ValueError):  # ValueError: a result that its enum does not have
            return False
        return True

    def at(self, time_s: float) -> FloatArray:
        """Return (3, m) position, velocity and acceleration ``time_s`` after the start."""
        state: FloatArray = np.array(self._trajectory.at_time(time_s))
        return state

    def leaves(self, lower: FloatArray, upper: FloatArray) -> BoolArray:
        """Return (m,) joints that the plan takes below ``lower`` or above ``upper``."""
        extrema = np.array([(each.min, each.max) for each in self._trajectory.position_extrema])
        left: BoolArray = (extrema[:, 0] < lower) | (extrema[:, 1] > upper)
        return left
