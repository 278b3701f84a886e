"""Differential drive: wheel speeds from a twist and back, and where the wheels have led.

The base's frame has x ahead and y to the left; angles count counter-clockwise, seen from above.
Its origin is the middle between the wheels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple


class PlanarTwist(NamedTuple):
    """Velocity of the base: ahead in m/s, turning in rad/s."""

    linear: float
    angular: float

    def scaled(self, factor: float) -> PlanarTwist:
        """Return the twist on the same arc, ``factor`` times as fast."""
        return PlanarTwist(self.linear * factor, self.angular * factor)


ZERO_TWIST = PlanarTwist(0.0, 0.0)


class Pose(NamedTuple):
    """Pose of the base in m, heading from -π to π in rad."""

    x: float
    y: float
    heading: float


ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class WheelPair:
    """Two wheels on one axle.

    Attributes:
        radius, separation: in m, positive.
        left_multiplier, right_multiplier: calibrated factors of the radius of each wheel, positive.
    """

    radius: float
    separation: float
    left_multiplier: float = 1.0
    right_multiplier: float = 1.0

    @property
    def radii(self) -> tuple[float, float]:
        """Calibrated radii (left, right) in m."""
        return self.radius * self.left_multiplier, self.radius * self.right_multiplier

    def speeds(self, twist: PlanarTwist) -> tuple[float, float]:
        """Angular velocities (left, right) in rad/s that move the base by ``twist``."""
        turning = twist.angular * self.separation / 2
        left, right = self.radii
        return (twist.linear - turning) / left, (twist.linear + turning) / right

    def twist(self, left: float, right: float) -> PlanarTwist:
        """Invert ``speeds``; for wheel angles in rad the result is a displacement."""
        left, right = left * self.radii[0], right * self.radii[1]
        return PlanarTwist((right + left) / 2, (right - left) / self.separation)


class Odometry:
    """Dead reckoning: the pose since the last ``reset``, from the positions of the wheels.

    Between two updates each wheel is taken to turn evenly, so the base runs along an arc, which
    is integrated exactly. The first update after the start, or after ``rebase``, only takes the
    wheels' positions as the baseline. Not thread-safe.

    Args:
        wheels: their geometry.
        wrap: range in rad after which a wheel's position begins again; None: it never does.
    """

    def __init__(self, wheels: WheelPair, wrap: float | None = None) -> None:
        self.pose = ORIGIN
        self._wheels = wheels
        self._wrap = wrap
        self._last: tuple[float, float] | None = None

    def update(self, left: float, right: float, longest_step: float = math.inf) -> bool:
        """Move on to the wheels' positions in rad, which are finite.

        False, and a new baseline, when a wheel is further from its last position than
        ``longest_step`` rad: it was not turned, its position was given another number.
        """
        last, self._last = self._last, (left, right)
        if last is None:
            return True
        left_step, right_step = self._step(left - last[0]), self._step(right - last[1])
        if max(abs(left_step), abs(right_step)) > longest_step:
            return False
        self.pose = along_arc(self.pose, self._wheels.twist(left_step, right_step))
        return True

    def rebase(self) -> None:
        """Take the next positions as the baseline, wherever they are; the pose stays."""
        self._last = None

    def reset(self, pose: Pose = ORIGIN) -> None:
        """Make ``pose`` the present one."""
        self.pose = pose

    def _step(self, change: float) -> float:
        return change if self._wrap is None else math.remainder(change, self._wrap)


def along_arc(pose: Pose, way: PlanarTwist) -> Pose:
    """``pose`` after ``way``: an arc of length ``linear`` that turns by ``angular``.

    The chord of an arc of length s and angle a is s · sin(a/2) / (a/2), in the direction of the
    mean heading. In this form nothing cancels where the arc is almost straight.
    """
    half = way.angular / 2
    chord = way.linear * _sinc(half)
    direction = pose.heading + half
    return Pose(
        pose.x + chord * math.cos(direction),
        pose.y + chord * math.sin(direction),
        math.remainder(pose.heading + way.angular, 2 * math.pi),
    )


def _sinc(angle: float) -> float:
    """sin(angle) / angle, 1 at 0."""
    return math.sin(angle) / angle if angle else 1.0
