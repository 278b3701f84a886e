"""Kinematics of wheeled bases: wheel speeds from a twist, and back.

Differential drive and skid steering (wheels on two sides, each side at one speed), mecanum drive
(four wheels with rollers at 45°, which move the base in every direction), and tricycle drive (one
driven wheel or axle, and one steered wheel; also Ackermann steering). Wheels that are steered by a
linkage are taken as one wheel in the middle (single-track model).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol, runtime_checkable

from robotd.motion.planar import PlanarTwist


@runtime_checkable
class BaseKinematics(Protocol):
    """Wheel speeds from a twist, and back; pure functions, any thread.

    The wheels have a fixed order. No wheel's rim is faster than
    ``|linear| + |lateral| + lever · |angular|``.
    """

    @property
    def moves_sideways(self) -> bool:
        """The base can have a lateral velocity."""

    @property
    def turns_on_the_spot(self) -> bool:
        """The base can turn without a linear velocity."""

    @property
    def steered(self) -> tuple[int, ...]:
        """Places of steering axes, whose part in ``speeds`` and ``twist`` is their angle in rad."""

    @property
    def radius(self) -> float:
        """Radius of the smallest wheel in m."""

    @property
    def lever(self) -> float:
        """Rim speed of the wheels in m/s per rad/s of turning on the spot."""

    def speeds(self, twist: PlanarTwist) -> tuple[float, ...]:
        """Angular velocities of the wheels in rad/s that move the base by ``twist``."""

    def twist(self, *turns: float) -> PlanarTwist:
        """Invert ``speeds``; for wheel angles in rad the result is a displacement.

        Of more wheels than degrees of freedom, the least-squares solution.
        """


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


@dataclass(frozen=True)
class MecanumWheels:
    """Kinematics of four wheels: front left, front right, rear left, rear right.

    The rollers that touch the ground lie along the diagonals of the base, seen from above as an X.
    The base's frame is in the middle of the wheels. Formulas: Taheri, Qiao, Ghaeminezhad,
    "Kinematic Model of a Four Mecanum Wheeled Mobile Robot", IJCA 113(3), 2015.

    Attributes:
        radius: of the wheels in m, positive.
        separation: distance between the left and the right wheels in m, positive.
        wheelbase: distance between the front and the rear wheels in m, positive.
    """

    moves_sideways: ClassVar[bool] = True
    turns_on_the_spot: ClassVar[bool] = True
    steered: ClassVar[tuple[int, ...]] = ()

    radius: float
    separation: float
    wheelbase: float

    @property
    def lever(self) -> float:
        """Half of track plus wheelbase in m."""
        return (self.separation + self.wheelbase) / 2

    def speeds(self, twist: PlanarTwist) -> tuple[float, ...]:
        """Angular velocities of the four wheels in rad/s that move the base by ``twist``."""
        ahead, left, turning = twist.linear, twist.lateral, twist.angular * self.lever
        return (
            (ahead - left - turning) / self.radius,
            (ahead + left + turning) / self.radius,
            (ahead + left - turning) / self.radius,
            (ahead - left + turning) / self.radius,
        )

    def twist(self, *turns: float) -> PlanarTwist:
        """Invert ``speeds``; for wheel angles in rad the result is a displacement.

        Four wheels have three degrees of freedom: of turns that contradict each other, because
        wheels slip, the result is the least-squares solution.
        """
        front_left, front_right, rear_left, rear_right = turns
        quarter = self.radius / 4
        return PlanarTwist(
            quarter * (front_left + front_right + rear_left + rear_right),
            quarter * (-front_left + front_right - rear_left + rear_right) / self.lever,
            quarter * (-front_left + front_right + rear_left - rear_right),
        )


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
