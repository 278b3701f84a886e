"""Bases with wheels on two sides, each side at one speed: differential and skid steering."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

from pydantic import Field

from robotd.api.bases import (
    Axis,
    BaseKinematics,
    DriveSettings,
    Key,
    PlanarTwist,
    Positive,
    SectionProblem,
)

SEPARATION = "Distance between the treads of the left and the right wheels."


class TwoSidedDrive(DriveSettings):
    """A base that turns by the difference in speed of its left and right wheels."""

    KINEMATICS = "robotd_bases.diff_drive:two_sided_wheels"

    wheel_separation_m: Positive = Field(description=SEPARATION)
    wheel_separation_multiplier: Positive = Field(
        1.0, description="Calibrated factor of the separation; above 1 where wheels slip in turns."
    )
    left_wheel_radius_multiplier: Positive = Field(
        1.0, description="Calibrated factor of the radius of the left wheels."
    )
    right_wheel_radius_multiplier: Positive = Field(
        1.0, description="Calibrated factor of the radius of the right wheels."
    )

    @property
    def wheels_per_side(self) -> int:
        """Number of wheels on each side; the left ones come first in ``axes``."""
        return len(self.axes) // 2

    @property
    def sides(self) -> tuple[range, range]:
        half = self.wheels_per_side
        return range(half), range(half, 2 * half)

    @property
    def dimensions(self) -> str:
        return f"{self.wheel_separation_m:g} m apart"


class DifferentialDrive(TwoSidedDrive):
    """A base on two driven wheels on one axle."""

    AXIS_KEYS = ("left_axis", "right_axis")

    kind: Literal["differential"] = Field("differential", description="Kind of the base.")
    left_axis: Axis = Field(description="Axis of the device that turns the left wheel.")
    right_axis: Axis = Field(description="Axis of the device that turns the right wheel.")


class SkidSteerDrive(TwoSidedDrive):
    """A base on several driven wheels a side, all of a side at one speed."""

    AXIS_KEYS = ("left_axes", "right_axes")

    kind: Literal["skid_steer"] = Field(description="Kind of the base.")
    left_axes: tuple[Axis, ...] = Field(
        strict=False, min_length=1, description="Axes that turn the left wheels, front to rear."
    )
    right_axes: tuple[Axis, ...] = Field(
        strict=False, min_length=1, description="Axes that turn the right wheels, front to rear."
    )

    @property
    def keyed_axes(self) -> tuple[tuple[Key, int], ...]:
        return tuple(
            ((key, index), axis)
            for key in self.AXIS_KEYS
            for index, axis in enumerate(getattr(self, key))
        )

    @property
    def wheel_names(self) -> tuple[str, ...]:
        numbers = range(1, self.wheels_per_side + 1)
        return tuple(f"{side} wheel {number}" for side in ("left", "right") for number in numbers)

    def problems(self) -> Iterator[SectionProblem]:
        yield from super().problems()
        if len(self.left_axes) != len(self.right_axes):
            what = f"must be as many as left_axes ({len(self.left_axes)})"
            yield ("right_axes",), what, self.right_axes


def two_sided_wheels(settings: TwoSidedDrive) -> BaseKinematics:
    """Return the kinematics of a two-sided base, calibrated."""
    return TwoSidedWheels(
        settings.wheel_radius_m,
        settings.wheel_separation_m * settings.wheel_separation_multiplier,
        settings.left_wheel_radius_multiplier,
        settings.right_wheel_radius_multiplier,
        settings.wheels_per_side,
    )


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
