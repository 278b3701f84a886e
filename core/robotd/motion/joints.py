"""Limits and present state of joints, as planning needs them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.descriptor.joint_settings import FULL_ACCELERATION_S, JointSettings
from robotd.descriptor.model import TrajectorySettings
from robotd.motion.limits import AxisLimits


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of the joints of one trajectory client, in axis order. Arrays of shape (m,).

    Attributes:
        names: unique joint names; their order is the order of every other array.
        lower, upper: position limits in rad or m; -inf and inf where there is none.
        velocity, acceleration: positive, in rad/s and rad/s² (m/s, m/s²); inf where unlimited.
        units: of position, "rad" or "m", one per joint.
        device_velocity, device_acceleration: what the device itself clips or rejects by, without
            the margins of the settings; empty: inf.
        jerk: positive, in rad/s³ (m/s³), of streamed motion; empty: the acceleration limit is
            reached in ``FULL_ACCELERATION_S``.

    Raises:
        ValueError: a shape is wrong, a range is empty or a limit is not positive.
    """

    names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    units: tuple[str, ...] = field(default=())
    jerk: FloatArray = field(default_factory=lambda: np.zeros(0))
    device_velocity: FloatArray = field(default_factory=lambda: np.zeros(0))
    device_acceleration: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        count = len(self.names)
        if len(set(self.names)) != count:
            raise ValueError(f"joint names {self.names} are not unique")
        if not self.units:
            object.__setattr__(self, "units", ("rad",) * count)
        if not len(self.jerk):
            object.__setattr__(self, "jerk", self.acceleration / FULL_ACCELERATION_S)
        for name in ("device_velocity", "device_acceleration"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(count, np.inf))
        for each in fields(self):
            if np.shape(getattr(self, each.name)) != (count,):
                raise ValueError(f"{each.name} limits do not match {count} joints")
        if not (self.lower < self.upper).all():
            raise ValueError("a lower position limit is not below its upper one")
        if not all((each > 0).all() for each in (self.velocity, self.acceleration, self.jerk)):
            raise ValueError("velocity, acceleration and jerk limits must be positive")

    @classmethod
    def of_joints(cls, joints: Sequence[JointSettings]) -> JointLimits:
        """Return the limits of a descriptor's joints."""
        return cls(
            tuple(joint.name for joint in joints),
            np.array([joint.lower for joint in joints]),
            np.array([joint.upper for joint in joints]),
            np.array([joint.velocity for joint in joints]),
            np.array([joint.acceleration for joint in joints]),
            tuple(joint.unit for joint in joints),
            np.array([joint.jerk for joint in joints]),
        )

    def of(self, columns: IntArray) -> JointLimits:
        """Return the limits of some of the joints; ``columns``: (k,) their indices."""
        arrays = {
            each.name: getattr(self, each.name)[columns]
            for each in fields(self)
            if each.name not in ("names", "units")
        }
        names = tuple(self.names[column] for column in columns)
        return JointLimits(names, units=tuple(self.units[column] for column in columns), **arrays)

    def per_joint(self) -> list[AxisLimits]:
        """Return the limits of each joint as those of its axis."""
        arrays = self.lower, self.upper, self.velocity, self.acceleration
        rows = zip(*(array.tolist() for array in arrays), self.units, strict=True)
        return [AxisLimits(*row) for row in rows]

    def start_tolerance(self, settings: TrajectorySettings) -> FloatArray:
        """Return ``start_tolerance_rad`` or ``_m`` of each joint; shape (m,)."""
        return self._by_unit(settings.start_tolerance_rad, settings.start_tolerance_m)

    def goal_tolerance(self, settings: TrajectorySettings) -> FloatArray:
        """Return ``goal_tolerance_rad`` or ``_m`` of each joint; shape (m,)."""
        return self._by_unit(settings.goal_tolerance_rad, settings.goal_tolerance_m)

    def path_tolerance(self, settings: TrajectorySettings) -> FloatArray:
        """Return ``path_tolerance_rad`` or ``_m`` of each joint, inf for null; shape (m,)."""
        return self._by_unit(settings.path_tolerance_rad, settings.path_tolerance_m)

    def stopped_velocity(self, settings: TrajectorySettings) -> FloatArray:
        """Return ``stopped_velocity_rad_s`` or ``_m_s`` of each joint; shape (m,)."""
        return self._by_unit(settings.stopped_velocity_rad_s, settings.stopped_velocity_m_s)

    def _by_unit(self, rad: float | None, m: float | None) -> FloatArray:
        values = {"rad": np.inf if rad is None else rad, "m": np.inf if m is None else m}
        return np.array([values[unit] for unit in self.units], np.float64)


@dataclass(frozen=True, eq=False)
class MotionState:
    """Commanded position, velocity and acceleration of the joints; shape (m,), SI units."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    def __post_init__(self) -> None:
        if len({getattr(self, part.name).shape for part in fields(self)}) != 1:
            raise ValueError("position, velocity and acceleration differ in shape")

    @classmethod
    def at_rest(cls, position: FloatArray) -> MotionState:
        """Return standstill at ``position`` (copied)."""
        return cls(np.array(position), np.zeros_like(position), np.zeros_like(position))
