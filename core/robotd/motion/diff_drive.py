"""Differential drive and skid steering: wheels on two sides, each side at one speed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from robotd.motion.planar import PlanarTwist


@dataclass(frozen=True)
class TwoSidedWheels:
    """Kinematics of left and right wheels; all wheels of a side have one speed.

    The base's frame is in the middle between them. A side counts as one wheel that turns by the
    mean of its wheels.

    Attributes:
        wheel_radius, separation: in m, positive.
        left_multiplier, right_multiplier: calibrated factors of the radius of each side, positive.
        per_side: wheels of each side; the left ones come first.
    """

    moves_sideways: ClassVar[bool] = False
    turns_on_the_spot: ClassVar[bool] = True
    steered: ClassVar[tuple[int, ...]] = ()

    wheel_radius: float
    separation: float
    left_multiplier: float = 1.0
    right_multiplier: float = 1.0
    per_side: int = 1

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
        """Half the distance between the sides in m."""
        return self.separation / 2

    def speeds(self, twist: PlanarTwist) -> tuple[float, ...]:
        """Angular velocities of all wheels in rad/s that move the base by ``twist``."""
        turning = twist.angular * self.separation / 2
        left, right = self.radii
        return (
            *((twist.linear - turning) / left,) * self.per_side,
            *((twist.linear + turning) / right,) * self.per_side,
        )

    def twist(self, *turns: float) -> PlanarTwist:
        """Invert ``speeds``; for wheel angles in rad the result is a displacement."""
        left = sum(turns[: self.per_side]) / self.per_side * self.radii[0]
        right = sum(turns[self.per_side :]) / self.per_side * self.radii[1]
        return PlanarTwist((right + left) / 2, (right - left) / self.separation)
