"""Joints of an arm: revolute, continuous and prismatic, each with limits in its unit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import StrEnum

from pydantic import Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from robotd.descriptor.section import Axis, Name, Positive, Problem, Section

INITIAL_MARGIN = 0.1  # part of the range between a limit and the initial position


class JointType(StrEnum):
    """Kind of a joint, in the words of URDF."""

    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"  # turns without position limits
    PRISMATIC = "prismatic"


_TURNING = ("velocity_rad_s", "acceleration_rad_s2")
_REQUIRED = {
    JointType.REVOLUTE: ("lower_rad", "upper_rad", *_TURNING),
    JointType.CONTINUOUS: _TURNING,
    JointType.PRISMATIC: ("lower_m", "upper_m", "velocity_m_s", "acceleration_m_s2"),
}
_OPTIONAL = {
    JointType.REVOLUTE: ("jerk_rad_s3", "rated_torque_nm", "torque_limit_nm"),
    JointType.CONTINUOUS: ("jerk_rad_s3", "rated_torque_nm", "torque_limit_nm"),
    JointType.PRISMATIC: ("jerk_m_s3", "rated_force_n", "force_limit_n"),
}
_OTHER_UNIT = {
    **dict(zip(_REQUIRED[JointType.REVOLUTE], _REQUIRED[JointType.PRISMATIC], strict=True)),
    **dict(zip(_OPTIONAL[JointType.REVOLUTE], _OPTIONAL[JointType.PRISMATIC], strict=True)),
}
_OTHER_UNIT |= {linear: turning for turning, linear in _OTHER_UNIT.items()}


class JointSettings(Section):
    """One joint of an arm, moved by one axis of the device.

    The keys carry the unit; ``lower`` to ``rated_effort`` are the same values for any type.
    """

    name: Name = Field(description="Name in JointState, in trajectories and in the URDF.")
    axis: Axis = Field(description="Axis of the device that moves the joint.")
    type: JointType = Field(
        JointType.REVOLUTE,
        strict=False,
        description="`continuous` turns without position limits; `prismatic` is in m and N,"
        " the others are in rad and N·m.",
    )
    lower_rad: float | None = Field(
        None,
        validate_default=True,
        description="Lowest position that a command may ask for; required if revolute.",
    )
    upper_rad: float | None = Field(
        None,
        validate_default=True,
        description="Highest position that a command may ask for; required if revolute.",
    )
    velocity_rad_s: Positive | None = Field(
        None,
        validate_default=True,
        description="Highest speed, in either direction; required unless prismatic.",
    )
    acceleration_rad_s2: Positive | None = Field(
        None,
        validate_default=True,
        description="Highest acceleration and deceleration; the ramp of a controlled stop;"
        " required unless prismatic.",
    )
    jerk_rad_s3: Positive | None = Field(
        None,
        description="Highest jerk of streamed motion; null: `acceleration_rad_s2` within 0.05 s.",
    )
    rated_torque_nm: Positive | None = Field(
        None, description="Torque at 100 % of the drive's rating; null reports the effort as NaN."
    )
    torque_limit_nm: Positive | None = Field(
        None, description="Highest torque of a torque stream; null: the joint takes none."
    )
    lower_m: float | None = Field(
        None, validate_default=True, description="As `lower_rad`; required if prismatic."
    )
    upper_m: float | None = Field(
        None, validate_default=True, description="As `upper_rad`; required if prismatic."
    )
    velocity_m_s: Positive | None = Field(
        None, validate_default=True, description="As `velocity_rad_s`; required if prismatic."
    )
    acceleration_m_s2: Positive | None = Field(
        None, validate_default=True, description="As `acceleration_rad_s2`; required if prismatic."
    )
    jerk_m_s3: Positive | None = Field(None, description="As `jerk_rad_s3`, of a prismatic joint.")
    rated_force_n: Positive | None = Field(
        None, description="Force at 100 % of the drive's rating, of a prismatic joint."
    )
    force_limit_n: Positive | None = Field(
        None, description="As `torque_limit_nm`, of a prismatic joint."
    )

    @property
    def unit(self) -> str:
        """Unit of the position: "rad" or "m"."""
        return "m" if self.type is JointType.PRISMATIC else "rad"

    @property
    def lower(self) -> float:
        """Lowest position in ``unit``; -inf if continuous."""
        return self._limit("lower_rad", -math.inf)

    @property
    def upper(self) -> float:
        """Highest position in ``unit``; inf if continuous."""
        return self._limit("upper_rad", math.inf)

    @property
    def velocity(self) -> float:
        """Highest speed in ``unit``/s."""
        return self._limit("velocity_rad_s", math.inf)

    @property
    def acceleration(self) -> float:
        """Highest acceleration and deceleration in ``unit``/s²."""
        return self._limit("acceleration_rad_s2", math.inf)

    @property
    def jerk(self) -> float:
        """Highest jerk of streamed motion in ``unit``/s³; NaN: not given."""
        return self._limit("jerk_rad_s3", math.nan)

    @property
    def rated_effort(self) -> float | None:
        """N·m or N at 100 % of the drive's rating; None: not known."""
        return self.rated_force_n if self.type is JointType.PRISMATIC else self.rated_torque_nm

    @property
    def effort_limit(self) -> float | None:
        """Highest N·m or N of a torque stream; None: the joint takes none."""
        return self.force_limit_n if self.type is JointType.PRISMATIC else self.torque_limit_nm

    @property
    def initial_position(self) -> float:
        """Position at which a simulation begins: 0, or the nearest one well inside the limits."""
        span = self.upper - self.lower
        if not math.isfinite(span):
            return min(max(0.0, self.lower), self.upper)
        return min(max(0.0, self.lower + INITIAL_MARGIN * span), self.upper - INITIAL_MARGIN * span)

    def key(self, turning: str) -> str:
        """Return the key of this joint for ``turning``, the key of a revolute one."""
        return _OTHER_UNIT[turning] if self.type is JointType.PRISMATIC else turning

    def problems(self) -> Iterator[Problem]:
        if self.lower >= self.upper:
            lower, upper = self.key("lower_rad"), self.key("upper_rad")
            yield (lower,), f"must be less than {upper} ({self.upper})", self.lower

    @field_validator(*_OTHER_UNIT)
    @classmethod
    def _fits_type(cls, value: float | None, info: ValidationInfo) -> float | None:
        """Require the keys of the joint's type, and reject those of another one."""
        key, kind = str(info.field_name), info.data.get("type")
        if kind is None:  # the type itself is wrong, and reported
            return value
        if value is None:
            if key in _REQUIRED[kind]:
                raise PydanticCustomError("missing", "missing")
        elif key not in (*_REQUIRED[kind], *_OPTIONAL[kind]):
            other = _OTHER_UNIT[key]
            known = other in (*_REQUIRED[kind], *_OPTIONAL[kind])
            hint = f"use {other}" if known else "use type: revolute for a joint with an end"
            what = f"a {kind} joint has no such key; {hint}"
            raise PydanticCustomError("robotd", "{what}", {"what": what})
        return value

    def _limit(self, key: str, default: float) -> float:
        value: float | None = getattr(self, self.key(key))
        return default if value is None else value
