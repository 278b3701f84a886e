"""Differential drive: two wheels on one axle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from robotd.motion.planar import PlanarTwist


@dataclass(frozen=True)
class WheelPair:
    """Kinematics of a left and a right wheel.

    The base's frame is in the middle between them.

    Attributes:
        wheel_radius, separation: in m, positive.
        left_multiplier, right_multiplier: calibrated factors of the radius of each wheel, positive.
    """

    moves_sideways: ClassVar[bool] = False
    turns_on_the_spot: ClassVar[bool] = True
    steered: ClassVar[tuple[int, ...]] = ()

    wheel_radius: float
    separation: float
    left_multiplier: float = 1.0
    right_multiplier: float = 1.0

    @cached_property
    def radii(self) -> tuple[float, float]:
        """Calibrated radii (left, right) in m."""
        return self.wheel_radius * self.left_multiplier, self.wheel_radius * self.right_multiplier

    @property
    def radius(self) -> float:
        """Radius of the smaller wheel in m."""
        return min(self.radii)

    @property
    def lever(self) -> float:
        """Half the distance between the wheels in m."""
        return self.separation / 2

    def speeds(self, twist: PlanarTwist) -> tuple[float, ...]:
        """Angular velocities (left, right) in rad/s that move the base by ``twist``."""
        turning = twist.angular * self.separation / 2
        left, right = self.radii
        return (twist.linear - turning) / left, (twist.linear + turning) / right

    def twist(self, *turns: float) -> PlanarTwist:
        """Invert ``speeds``; for wheel angles in rad the result is a displacement."""
        left, right = turns
        left, right = left * self.radii[0], right * self.radii[1]
        return PlanarTwist((right + left) / 2, (right - left) / self.separation)
