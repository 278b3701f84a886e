"""Descriptor's section ``drive``: the part that all kinds of mobile bases have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, NamedTuple

from pydantic import Field

from robotd.descriptor.section import Key, Name, Positive, Problem, Section, twice


class SteeringAxis(NamedTuple):
    """An axis that steers, in position mode.

    Attributes:
        axis: of the device.
        lower_rad, upper_rad: range of its angle.
        velocity_rad_s, acceleration_rad_s2: highest ones of steering.
    """

    axis: int
    lower_rad: float
    upper_rad: float
    velocity_rad_s: float
    acceleration_rad_s2: float


class DriveSettings(Section):
    """A base on wheels, each turned or steered by one axis.

    A kind is a subclass, with ``kind`` as a ``Literal`` field and a field for each of
    ``AXIS_KEYS``. All values are checked against the fields before ``problems`` is called.
    """

    AXIS_KEYS: ClassVar[tuple[str, ...]]
    """Fields with the axes, in the order of the wheels."""
    KINEMATICS: ClassVar[str] = ""
    """``package.module:function``, called with the settings. It returns the ``BaseKinematics`` of
    wheels in the order of ``axes``; where some of them steer, ``SteeredKinematics``."""

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
    def steering(self) -> tuple[SteeringAxis, ...]:
        """Those of ``axes`` that steer, with their limits; the others are in velocity mode."""
        return ()

    @property
    def steering_axes(self) -> tuple[int, ...]:
        """Axes of ``steering``."""
        return tuple(wheel.axis for wheel in self.steering)

    @property
    def wheel_deceleration(self) -> float:
        """Ramp of a controlled stop of a driven wheel, rad/s²."""
        return self.deceleration_m_s2 / self.wheel_radius_m

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of the wheels for people, in the order of ``axes``."""
        keys = (key.removesuffix("_axis") for key in self.AXIS_KEYS)
        return tuple(f"{key.replace('_', ' ')} wheel" for key in keys)

    @property
    def sides(self) -> tuple[Sequence[int], Sequence[int]]:
        """Places in ``axes`` of the left and of the right wheels, which a URDF has to confirm.

        Empty: they are not compared.
        """
        return (), ()

    @property
    def dimensions(self) -> str:
        """Dimensions besides the radius of the wheels, in words; "" for none."""
        return ""

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


class OmnidirectionalDrive(DriveSettings):
    """A base that moves in every direction."""

    lateral_velocity_m_s: Positive = Field(description="Highest speed sideways.")
    lateral_acceleration_m_s2: Positive = Field(description="Highest acceleration sideways.")
    lateral_deceleration_m_s2: Positive = Field(description="Highest deceleration sideways.")
    lateral_jerk_m_s3: Positive | None = Field(
        None, description="Highest jerk sideways; null: not limited."
    )
