"""Models of the descriptor's section ``drive``: one for each kind of mobile base."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from robotd.descriptor.section import (
    Axis,
    Key,
    Name,
    Positive,
    Problem,
    Section,
    twice,
)

_SEPARATION = "Distance between the treads of the left and the right wheels."
MAX_FIXED_ANGLE = 1.4  # rad; at π/2 a base whose fixed axle drives cannot move


class DriveSettings(Section):
    """A base on wheels, each turned or steered by one axis.

    A plugin's kind is a subclass, with ``kind`` as a ``Literal`` field and a field for each of
    ``AXIS_KEYS``. All values are checked against the fields before ``problems`` is called.
    """

    AXIS_KEYS: ClassVar[tuple[str, ...]]
    """Fields with the axes, in the order of the wheels."""
    KINEMATICS: ClassVar[str] = ""
    """``package.module:function`` of a plugin's kind, called with the settings. It returns the
    ``BaseKinematics`` of wheels in the order of ``axes``; none of them is steered."""

    kind: str
    wheel_radius_m: Positive = Field(description="Radius of the wheels.")
    wheel_wrap_rad: Positive | None = Field(
        None, description="Range after which a wheel's position begins again; null: it never does."
    )
    wheel_velocity_rad_s: Positive | None = Field(
        None, description="Highest speed of a wheel; null: whatever the twist's limits give."
    )
    wheel_joints: tuple[Name, ...] = Field(
        (),
        strict=False,
        description="Joints of the wheels in the URDF, in the order of their axes, for the "
        "transforms of `robot_state_publisher`; empty: the wheels stand still there.",
    )
    velocity_m_s: Positive = Field(description="Highest speed, ahead and back.")
    acceleration_m_s2: Positive = Field(description="Highest acceleration.")
    deceleration_m_s2: Positive = Field(description="Highest deceleration.")
    jerk_m_s3: Positive | None = Field(None, description="Highest jerk; null: not limited.")
    angular_velocity_rad_s: Positive = Field(description="Highest speed of turning.")
    angular_acceleration_rad_s2: Positive = Field(description="Highest acceleration of turning.")
    angular_deceleration_rad_s2: Positive = Field(description="Highest deceleration of turning.")
    angular_jerk_rad_s3: Positive | None = Field(
        None, description="Highest jerk of turning; null: not limited."
    )
    command_timeout_s: Positive = Field(
        0.5, description="Age of the last command at which the base slows to rest."
    )

    @property
    def keyed_axes(self) -> tuple[tuple[Key, int], ...]:
        """The axes of the wheels in their order, each with its key below ``drive``."""
        return tuple(((key,), getattr(self, key)) for key in self.AXIS_KEYS)

    @property
    def axes(self) -> tuple[int, ...]:
        """The axes of the wheels, in their order."""
        return tuple(axis for _, axis in self.keyed_axes)

    @property
    def steering_axes(self) -> tuple[int, ...]:
        """Those of ``axes`` that steer, in position mode; the others are in velocity mode."""
        return ()

    @property
    def wheel_deceleration(self) -> float:
        """Ramp of a controlled stop of a driven wheel, rad/s²."""
        return self.deceleration_m_s2 / self.wheel_radius_m

    @property
    def steering_ramps(self) -> dict[int, float]:
        """Highest acceleration of each of ``steering_axes``, rad/s², by axis."""
        return {}

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of the wheels for people, in the order of ``axes``."""
        keys = (key.removesuffix("_axis") for key in self.AXIS_KEYS)
        return tuple(f"{key.replace('_', ' ')} wheel" for key in keys)

    def problems(self) -> Iterator[Problem]:
        first: dict[int, str] = {}
        for key, axis in self.keyed_axes:
            if axis in first:
                yield key, f"used before, by {first[axis]}", axis
            first.setdefault(axis, ".".join(map(str, key)))
        yield from twice("wheel_joints", enumerate(self.wheel_joints))
        if self.wheel_joints and len(self.wheel_joints) != len(self.axes):
            what = f"must be as many as wheels ({len(self.axes)}), or none"
            yield ("wheel_joints",), what, self.wheel_joints


class TwoSidedDrive(DriveSettings):
    """A base that turns by the difference in speed of its left and right wheels."""

    wheel_separation_m: Positive = Field(description=_SEPARATION)
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

    def problems(self) -> Iterator[Problem]:
        yield from super().problems()
        if len(self.left_axes) != len(self.right_axes):
            what = f"must be as many as left_axes ({len(self.left_axes)})"
            yield ("right_axes",), what, self.right_axes


class OmnidirectionalDrive(DriveSettings):
    """A base that moves in every direction."""

    lateral_velocity_m_s: Positive = Field(description="Highest speed sideways.")
    lateral_acceleration_m_s2: Positive = Field(description="Highest acceleration sideways.")
    lateral_deceleration_m_s2: Positive = Field(description="Highest deceleration sideways.")
    lateral_jerk_m_s3: Positive | None = Field(
        None, description="Highest jerk sideways; null: not limited."
    )


class MecanumDrive(OmnidirectionalDrive):
    """A base on four mecanum wheels, whose rollers form an X, seen from above."""

    AXIS_KEYS = ("front_left_axis", "front_right_axis", "rear_left_axis", "rear_right_axis")

    kind: Literal["mecanum"] = Field(description="Kind of the base.")
    front_left_axis: Axis = Field(description="Axis that turns the front left wheel.")
    front_right_axis: Axis = Field(description="Axis that turns the front right wheel.")
    rear_left_axis: Axis = Field(description="Axis that turns the rear left wheel.")
    rear_right_axis: Axis = Field(description="Axis that turns the rear right wheel.")
    wheel_separation_m: Positive = Field(description=_SEPARATION)
    wheelbase_m: Positive = Field(description="Distance between the front and the rear axles.")


class TricycleDrive(DriveSettings):
    """A base on a fixed axle and one steered wheel (or a pair steered together)."""

    AXIS_KEYS = ("traction_axis", "steering_axis")

    kind: Literal["tricycle"] = Field(description="Kind of the base.")
    traction_axis: Axis = Field(description="Axis that drives the base, in velocity mode.")
    steering_axis: Axis = Field(
        description="Axis that steers, in position mode; 0 is straight ahead, positive to the left."
    )
    traction: Literal["steered", "fixed"] = Field(
        "steered", description="The steered wheel drives, or the wheels of the fixed axle."
    )
    wheelbase_m: Positive = Field(description="Distance from the fixed axle to the steered wheel.")
    steering_angle_rad: float = Field(
        gt=0, le=math.pi / 2, description="Largest steering angle to either side."
    )
    steering_velocity_rad_s: Positive = Field(description="Highest speed of steering.")
    steering_acceleration_rad_s2: Positive = Field(description="Highest acceleration of steering.")

    @property
    def steering_axes(self) -> tuple[int, ...]:
        return (self.steering_axis,)

    @property
    def steering_ramps(self) -> dict[int, float]:
        return {self.steering_axis: self.steering_acceleration_rad_s2}

    def problems(self) -> Iterator[Problem]:
        yield from super().problems()
        if self.traction == "fixed" and self.steering_angle_rad > MAX_FIXED_ANGLE:
            what = f"must be at most {MAX_FIXED_ANGLE} where the fixed axle drives"
            yield ("steering_angle_rad",), what, self.steering_angle_rad
