"""Time-optimal, jerk-limited plans of independent joints, by ruckig."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import NamedTuple

from ruckig import (
    ControlInterface,
    InputParameter,
    Profile,
    Ruckig,
    RuckigError,
    Synchronization,
    Trajectory,
)

Row = list[float]  # one value for each joint; at six joints faster than an array

# Some boundary cases, such as a motion that just reaches the speed limit, have no solution in
# floating-point arithmetic; close to them there is one.
JERK_SHARES = (1.0, 0.999, 0.99, 0.9)
CONSTANT_PHASES = (1, 5)  # of a profile's seven: those with constant acceleration
_INTERFACES = (ControlInterface.Position, ControlInterface.Velocity)  # to a position, anywhere


class Bounds(NamedTuple):
    """Limits of one plan, lowest ≤ 0 ≤ highest, SI units."""

    lowest_velocity: Row
    highest_velocity: Row
    lowest_acceleration: Row
    highest_acceleration: Row
    jerk: Row

    @classmethod
    def symmetric(cls, velocity: Row, acceleration: Row, jerk: Row) -> Bounds:
        """Return the same limits in both directions."""
        return cls(
            [-limit for limit in velocity],
            velocity,
            [-limit for limit in acceleration],
            acceleration,
            jerk,
        )


class JointPlanner:
    """One plan for m joints, none of which waits for another. One thread."""

    def __init__(self, joints: int) -> None:
        self._ruckig = Ruckig(joints)
        self._input = InputParameter(joints)
        self._input.synchronization = Synchronization.No
        self._input.target_acceleration = [0.0] * joints
        self._trajectory = Trajectory(joints)
        self._anywhere = [False] * joints
        self._origin = self._zeros = [0.0] * joints
        self._bounds: Bounds | None = None
        self._jerk: Row = []  # of the last plan

    def plan(self, state: Sequence[Row], target: Row, velocity: Row, bounds: Bounds) -> bool:
        """Plan from ``state`` to each joint's target, without acceleration.

        Args:
            state: position, velocity and acceleration.
            target: positions; NaN: anywhere, at ``velocity``.
            velocity: at the target; afterwards the joint continues with it.
            bounds: of the motion.

        Returns False when ruckig finds no plan; ``at`` is then undefined.
        """
        parameters = self._input
        position, parameters.current_velocity, acceleration = state
        anywhere = [end != end for end in target]  # noqa: PLR0124 - NaN
        if anywhere != self._anywhere:
            self._anywhere, self._origin = anywhere, self._zeros
            parameters.per_dof_control_interface = [
                _INTERFACES[interface] for interface in anywhere
            ]
        if True in anywhere:
            # ruckig counts the target of the plan before among the extrema of a motion to anywhere,
            # 0 for the first: such a motion is the first of its trajectory, and starts at 0.
            self._trajectory = Trajectory(len(target))
            pairs = list(zip(position, anywhere, strict=True))
            self._origin = [value if free else 0.0 for value, free in pairs]
            position = [0.0 if free else value for value, free in pairs]
            target = [0.0 if end != end else end for end in target]  # noqa: PLR0124
        parameters.current_position = position
        parameters.current_acceleration = acceleration
        parameters.target_position = target
        parameters.target_velocity = velocity
        self._limit(bounds)
        return any(self._calculate(bounds.jerk, share) for share in JERK_SHARES)

    def _limit(self, bounds: Bounds) -> None:
        """Set the limits of the motion, if they are not those of the plan before."""
        if bounds is self._bounds:
            return
        self._bounds, parameters = bounds, self._input
        parameters.min_velocity = bounds.lowest_velocity
        parameters.max_velocity = bounds.highest_velocity
        parameters.min_acceleration = bounds.lowest_acceleration
        parameters.max_acceleration = bounds.highest_acceleration

    def _calculate(self, jerk: Row, share: float) -> bool:
        shared = jerk if share == 1.0 else [limit * share for limit in jerk]
        if shared != self._jerk:
            self._input.max_jerk = shared
            self._jerk = [*shared]
        try:
            self._ruckig.calculate(self._input, self._trajectory)
        except (RuckigError, ValueError):  # ValueError: a result that its enum does not have
            return False
        return True

    def at(self, time_s: float) -> tuple[Row, Row, Row]:
        """Return position, velocity and acceleration ``time_s`` after the start."""
        position, velocity, acceleration = self._trajectory.at_time(time_s)
        if self._origin is not self._zeros:
            position = list(map(operator.add, self._origin, position))
        return position, velocity, acceleration

    def leaves(self, lower: Row, upper: Row) -> list[bool]:
        """Return the joints that the plan takes below ``lower`` or above ``upper``."""
        (profiles,) = self._trajectory.profiles
        extrema = self._trajectory.position_extrema
        joints = zip(self._origin, extrema, profiles, lower, upper, strict=True)
        return [
            origin + extremes.min < low
            or origin + extremes.max > high
            or _turns_outside(profile, low - origin, high - origin)
            for origin, extremes, profile, low, high in joints
        ]


def _turns_outside(profile: Profile, low: float, high: float) -> bool:
    """Return True where the joint turns outside of the range with constant acceleration.

    ruckig 0.19 leaves these turning points out of its extrema.
    """
    velocity = profile.v
    for phase in CONSTANT_PHASES:
        before = velocity[phase]
        if before * velocity[phase + 1] < 0.0:
            turn = profile.p[phase] - before**2 / (2.0 * profile.a[phase])
            if turn < low or turn > high:
                return True
    return False
