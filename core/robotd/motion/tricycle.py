"""Tricycle drive: one driven wheel or axle, and one steered wheel; also Ackermann steering.

Wheels that are steered by a linkage are taken as one wheel in the middle (single-track model).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from robotd.motion.planar import PlanarTwist

ACROSS = 1e-3  # cosine of an angle that counts as π/2
STRAIGHT_M_S = 1e-6  # speed of the steered wheel below which its direction means nothing


@dataclass(frozen=True)
class SteeredWheels:
    """Kinematics of a base whose frame is in the middle of the fixed axle.

    The steered wheel rolls without slip towards its angle δ, so tan δ = wheelbase · angular /
    linear, and its rim has the speed √(linear² + (wheelbase · angular)²). Siegwart, Nourbakhsh,
    "Introduction to Autonomous Mobile Robots", 3.2.

    Attributes:
        radius: of the driven wheel in m, positive.
        wheelbase: from the fixed axle to the steered wheel in m, positive.
        drives_steered: the steered wheel is the driven one; else the fixed axle.
        largest_angle: of steering to either side, at most π/2 (less where the fixed axle drives).
    """

    moves_sideways: ClassVar[bool] = False
    steered: ClassVar[tuple[int, ...]] = (1,)

    radius: float
    wheelbase: float
    drives_steered: bool
    largest_angle: float

    @property
    def turns_on_the_spot(self) -> bool:
        """The steered wheel drives, and can stand across."""
        return self.drives_steered and math.cos(self.largest_angle) < ACROSS

    @property
    def lever(self) -> float:
        """Wheelbase in m where the steered wheel drives; 0 for the fixed axle."""
        return self.wheelbase if self.drives_steered else 0.0

    def speeds(self, twist: PlanarTwist) -> tuple[float, ...]:
        """Return the speed of the driven wheel in rad/s, and the steering angle in rad.

        Beyond the largest angle the base turns as sharply as it can, at the linear speed of
        ``twist``. A twist of (nearly) zero has the angle 0.
        """
        across = self.wheelbase * twist.angular
        if math.hypot(twist.linear, across) < STRAIGHT_M_S:
            return 0.0, 0.0
        back = twist.linear < 0.0
        angle = math.atan2(-across if back else across, abs(twist.linear))
        limited = max(-self.largest_angle, min(self.largest_angle, angle))
        sign = -1.0 if back else 1.0
        if not self.drives_steered:
            return twist.linear / self.radius, limited
        if limited == angle:
            return sign * math.hypot(twist.linear, across) / self.radius, angle
        return twist.linear / math.cos(limited) / self.radius, limited

    def twist(self, *turns: float) -> PlanarTwist:
        """Return the twist of a speed in rad/s at a steering angle in rad.

        For an angle of the driven wheel in rad the result is a displacement.
        """
        turn, angle = turns
        rim = turn * self.radius
        if self.drives_steered:
            return PlanarTwist(rim * math.cos(angle), rim * math.sin(angle) / self.wheelbase)
        return PlanarTwist(rim, rim * math.tan(angle) / self.wheelbase)
