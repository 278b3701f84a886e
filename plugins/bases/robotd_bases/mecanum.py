"""Bases on four mecanum wheels, whose rollers at 45° let them move in every direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import Field

from robotd.api.bases import Axis, BaseKinematics, OmnidirectionalDrive, PlanarTwist, Positive


class MecanumDrive(OmnidirectionalDrive):
    """A base on four mecanum wheels, whose rollers form an X, seen from above."""

    AXIS_KEYS = ("front_left_axis", "front_right_axis", "rear_left_axis", "rear_right_axis")
    KINEMATICS = "robotd_bases.mecanum:mecanum_wheels"

    kind: Literal["mecanum"] = Field(description="Kind of the base.")
    front_left_axis: Axis = Field(description="Axis that turns the front left wheel.")
    front_right_axis: Axis = Field(description="Axis that turns the front right wheel.")
    rear_left_axis: Axis = Field(description="Axis that turns the rear left wheel.")
    rear_right_axis: Axis = Field(description="Axis that turns the rear right wheel.")
    wheel_separation_m: Positive = Field(
        description="Distance between the treads of the left and the right wheels."
    )
    wheelbase_m: Positive = Field(description="Distance between the front and the rear axles.")

    @property
    def dimensions(self) -> str:
        return f"{self.wheel_separation_m:g} m apart"


def mecanum_wheels(settings: MecanumDrive) -> BaseKinematics:
    """Return the kinematics of a mecanum base."""
    return MecanumWheels(settings.wheel_radius_m, settings.wheel_separation_m, settings.wheelbase_m)


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
