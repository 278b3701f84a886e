"""Limits of a base's twist that keep the commanded curvature.

Whatever has to be reduced is reduced by one factor for all parts of the twist, so that a limit
makes the base slower but leaves it on the commanded arc.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from operator import mul

from robotd.motion.planar import ZERO_TWIST, PlanarTwist

_TOGETHER = 1e-9  # parts whose zeros are this close, as a part of the change, are zero together


@dataclass(frozen=True)
class RampLimits:
    """Limits of one part of a twist, positive, in m or rad and s.

    Attributes:
        velocity: in either direction.
        acceleration, deceleration: where the speed grows, and where it shrinks.
        jerk: inf: not limited.
    """

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float = math.inf


@dataclass(frozen=True)
class TwistLimits:
    """Limits of a twist.

    Attributes:
        linear, angular: of two of its parts.
        rim: highest speed of a wheel's rim in m/s, all parts together; inf: not limited.
        lever: speed of a wheel's rim in m/s while the base turns on the spot with 1 rad/s.
        lateral: of the third part; None: the base cannot move sideways, the part is always 0.
    """

    linear: RampLimits
    angular: RampLimits
    rim: float = math.inf
    lever: float = 0.0
    lateral: RampLimits | None = None

    @cached_property
    def parts(self) -> tuple[RampLimits, ...]:
        """The limits in the order of ``PlanarTwist``, without a ``lateral`` of None."""
        known = (self.linear, self.angular, self.lateral)
        return tuple(part for part in known if part is not None)

    def rim_speed(self, twist: PlanarTwist) -> float:
        """Return the speed of the fastest wheel's rim in m/s."""
        return abs(twist.linear) + abs(twist.lateral) + self.lever * abs(twist.angular)

    def scaled(self, twist: PlanarTwist) -> PlanarTwist:
        """``twist`` on its arc, as fast as the limits of velocity allow."""
        excess = max(1.0, self.rim_speed(twist) / self.rim)
        for speed, part in zip(twist, self.parts, strict=False):
            excess = max(excess, abs(speed) / part.velocity)
        return twist if excess == 1.0 else PlanarTwist(*(speed / excess for speed in twist))

    def smoothing(self) -> float:
        """Length in s of the moving average that keeps the jerk limits; 0.0 without any.

        Over T seconds an average changes its slope by (a₁ - a₀) / T, and a₁ - a₀ is at most
        twice the steeper ramp.
        """
        return max(2 * max(part.acceleration, part.deceleration) / part.jerk for part in self.parts)


class TwistLimiter:
    """Follows a commanded twist within limits, one step a period. One thread.

    Two stages: a ramp along the straight line to the command, which keeps velocity,
    acceleration and deceleration, and a moving average over the ramp, which keeps the jerk.
    Both map twists of one curvature to twists of that curvature. A command of another curvature
    is approached on the straight line between the two; a part that changes its sign does so
    by way of 0. During such a reversal the average may mix both ramps, and the steeper one is
    the limit.

    A stop takes the maximum of |speed| / deceleration of the parts,
    plus ``TwistLimits.smoothing``, each rounded up to a whole period.
    """

    def __init__(self, limits: TwistLimits, period_s: float) -> None:
        self._limits, self._parts = limits, limits.parts
        self._period_s = period_s
        self._length = max(1, math.ceil(limits.smoothing() / period_s - 1e-9))
        self.reset()

    @property
    def at_rest(self) -> bool:
        """The last step was to stand still, and without a command it stays so."""
        return self._ramp == ZERO_TWIST and self._same >= self._length

    def step(self, command: PlanarTwist) -> PlanarTwist:
        """The twist one period on; ``command`` is finite."""
        self._ramp = self._towards(self._limits.scaled(command))
        return self._average(self._ramp)

    def reset(self) -> None:
        """Stand still, at once."""
        self._keep(ZERO_TWIST)

    def speed_up_no_more(self) -> None:
        """Let the last step be the fastest one of a ramp that speeds up."""
        present = self._sum.scaled(1.0 / self._length)
        if any(abs(ramp) > abs(part) for ramp, part in zip(self._ramp, present, strict=True)):
            self._keep(present)

    def _keep(self, twist: PlanarTwist) -> None:
        self._ramp = twist
        self._recent = deque([twist] * self._length)
        self._sum = twist.scaled(self._length)
        self._same = self._length  # how many of the newest of ``_recent`` are equal

    def _towards(self, command: PlanarTwist) -> PlanarTwist:
        now, goal = self._ramp, _to_first_zero(self._ramp, command)
        excess = 1.0
        for present, wanted, limits in zip(now, goal, self._parts, strict=False):
            grows = abs(wanted) > abs(present)
            slope = limits.acceleration if grows else limits.deceleration
            excess = max(excess, abs(wanted - present) / (slope * self._period_s))
        return goal if excess == 1.0 else _between(now, goal, 1.0 / excess)

    def _average(self, twist: PlanarTwist) -> PlanarTwist:
        newest, oldest = self._recent[-1], self._recent.popleft()
        self._recent.append(twist)
        self._same = min(self._same, self._length) + 1 if twist == newest else 1
        count = self._length
        if self._same >= count:  # exact from here on, whatever the sum has gathered in rounding
            self._sum = twist.scaled(count)
            return twist
        total = self._sum = PlanarTwist(
            self._sum.linear + twist.linear - oldest.linear,
            self._sum.angular + twist.angular - oldest.angular,
            self._sum.lateral + twist.lateral - oldest.lateral,
        )
        return PlanarTwist(total.linear / count, total.angular / count, total.lateral / count)


def _between(start: PlanarTwist, end: PlanarTwist, part: float) -> PlanarTwist:
    return PlanarTwist(
        start.linear + part * (end.linear - start.linear),
        start.angular + part * (end.angular - start.angular),
        start.lateral + part * (end.lateral - start.lateral),
    )


def _to_first_zero(start: PlanarTwist, end: PlanarTwist) -> PlanarTwist:
    """``end``, or the first twist on the way there in which a part becomes 0."""
    if min(map(mul, start, end)) >= 0.0:
        return end
    zeros = [
        have / (have - want) if have * want < 0.0 else math.inf
        for have, want in zip(start, end, strict=True)
    ]
    first = min(zeros)
    parts = zip(_between(start, end, first), zeros, strict=True)
    return PlanarTwist(*(0.0 if zero <= first + _TOGETHER else part for part, zero in parts))
