"""Base on three omnidirectional wheels at 120°, as a kind of base for robotd."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import Field

from robotd.api.bases import Axis, BaseKinematics, OmnidirectionalDrive, PlanarTwist, Positive

ANGLES = (math.pi / 3, math.pi, -math.pi / 3)  # of the wheels, from straight ahead to the left


class OmniDrive(OmnidirectionalDrive):
    """Section ``drive`` of a robot's file."""

    AXIS_KEYS = ("left_axis", "rear_axis", "right_axis")
    KINEMATICS = "robotd_omni:kinematics"

    kind: Literal["omni"] = Field(description="Kind of the base.")
    left_axis: Axis = Field(description="Axis that turns the front left wheel.")
    rear_axis: Axis = Field(description="Axis that turns the rear wheel.")
    right_axis: Axis = Field(description="Axis that turns the front right wheel.")
    wheel_distance_m: Positive = Field(description="From the middle of the base to each wheel.")


@dataclass(frozen=True)
class OmniWheels:
    """Each wheel rolls across the line from the middle of the base, and slides along it."""

    moves_sideways: ClassVar[bool] = True
    turns_on_the_spot: ClassVar[bool] = True
    steered: ClassVar[tuple[int, ...]] = ()

    radius: float
    lever: float

    def speeds(self, twist: PlanarTwist) -> tuple[float, ...]:
        ahead, left, turning = twist.linear, twist.lateral, twist.angular * self.lever
        return tuple(
            (-math.sin(angle) * ahead + math.cos(angle) * left + turning) / self.radius
            for angle in ANGLES
        )

    def twist(self, *turns: float) -> PlanarTwist:
        rims = [turn * self.radius for turn in turns]
        ahead = sum(-math.sin(angle) * rim for angle, rim in zip(ANGLES, rims, strict=True))
        left = sum(math.cos(angle) * rim for angle, rim in zip(ANGLES, rims, strict=True))
        return PlanarTwist(ahead * 2 / 3, sum(rims) / 3 / self.lever, left * 2 / 3)


def kinematics(drive: OmniDrive) -> BaseKinematics:
    """Return the kinematics of a base; called where the robot is made."""
    return OmniWheels(drive.wheel_radius_m, drive.wheel_distance_m)
