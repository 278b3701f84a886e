"""Limits and present state of joints, and rules of their trajectories, as planning needs them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.motion.limits import AxisLimits

FULL_ACCELERATION_S = 0.05  # from standstill, of a joint without a jerk limit


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of the joints of one trajectory client, in axis order. Arrays of shape (m,).

    Attributes:
        names: unique joint names; their order is the order of every other array.
        lower, upper: position limits in rad or m; -inf and inf where there is none.
        velocity, acceleration: positive, in rad/s and rad/s² (m/s, m/s²); inf where unlimited.
        units: of position, "rad" or "m", one per joint.
        device_velocity, device_acceleration: what the device itself clips or rejects by, without
            the margins of the rules; empty: inf.
        jerk: positive, in rad/s³ (m/s³), of streamed motion; empty, or NaN of a joint: the
            acceleration limit is reached in ``FULL_ACCELERATION_S``.

    Raises ValueError: a shape is wrong, a range is empty or a limit is not positive.
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
        gentle = self.acceleration / FULL_ACCELERATION_S
        jerk = np.where(np.isnan(self.jerk), gentle, self.jerk) if len(self.jerk) else gentle
        object.__setattr__(self, "jerk", jerk)
        for name in ("device_velocity", "device_acceleration"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(count, np.inf))
        for limit in fields(self):
            if np.shape(getattr(self, limit.name)) != (count,):
                raise ValueError(f"{limit.name} limits do not match {count} joints")
        if not (self.lower < self.upper).all():
            raise ValueError("a lower position limit is not below its upper one")
        if not all((limit > 0).all() for limit in (self.velocity, self.acceleration, self.jerk)):
            raise ValueError("velocity, acceleration and jerk limits must be positive")

    def of(self, columns: IntArray) -> JointLimits:
        """Return the limits of some of the joints; ``columns``: (k,) their indices."""
        arrays = {
            field.name: getattr(self, field.name)[columns]
            for field in fields(self)
            if field.name not in ("names", "units")
        }
        names = tuple(self.names[column] for column in columns)
        return JointLimits(names, units=tuple(self.units[column] for column in columns), **arrays)

    def per_joint(self) -> list[AxisLimits]:
        """Return the limits of each joint as those of its axis."""
        arrays = self.lower, self.upper, self.velocity, self.acceleration
        rows = zip(*(array.tolist() for array in arrays), self.units, strict=True)
        return [AxisLimits(*row) for row in rows]


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


@dataclass(frozen=True, eq=False)
class TrajectoryRules:
    """Rules of the trajectories of m joints, as numbers in the joints' units.

    Attributes:
        path_tolerance, goal_tolerance: (m,) of goals that have none of their own; inf: unchecked.
        goal_time_s: time after the end to get within ``goal_tolerance``; inf: without an end.
        start_tolerance: (m,) distance from the present position of a first point at time 0.
        stopped_velocity: (m,) speed below which a joint is at rest.
        max_points: of one trajectory.
        velocity_margin: part by which a path may exceed the velocity limits.
        acceleration_margin: the same of accelerations; None: by any.
        allow_partial_joints: goals of some of the joints; the others have to be at rest.
        allow_end_velocity: last points with a velocity.
    """

    path_tolerance: FloatArray
    goal_tolerance: FloatArray
    goal_time_s: float
    start_tolerance: FloatArray
    stopped_velocity: FloatArray
    max_points: int
    velocity_margin: float
    acceleration_margin: float | None
    allow_partial_joints: bool
    allow_end_velocity: bool
