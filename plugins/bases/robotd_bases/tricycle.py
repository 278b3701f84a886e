"""Bases with one steered wheel, and one driven wheel or axle; also Ackermann steering.

Wheels that are steered by a linkage are taken as one wheel in the middle (single-track model).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import Field

from robotd.api.bases import (
    Axis,
    BaseKinematics,
    DriveSettings,
    PlanarTwist,
    Positive,
    SectionProblem,
    SteeringAxis,
    WheelFollower,
)

MAX_FIXED_ANGLE = 1.4  # rad; at π/2 a base whose fixed axle drives cannot move


class TricycleDrive(DriveSettings):
    """A base on a fixed axle and one steered wheel (or a pair steered together)."""

    AXIS_KEYS = ("traction_axis", "steering_axis")
    KINEMATICS = "robotd_bases.tricycle:steered_wheels"

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
    def steering(self) -> tuple[SteeringAxis, ...]:
        angle = self.steering_angle_rad
        limits = self.steering_velocity_rad_s, self.steering_acceleration_rad_s2
        return (SteeringAxis(self.steering_axis, -angle, angle, *limits),)

    @property
    def dimensions(self) -> str:
        return f"wheelbase {self.wheelbase_m:g} m, steers {self.steering_angle_rad:g} rad"

    def problems(self) -> Iterator[SectionProblem]:
        yield from super().problems()
        if self.traction == "fixed" and self.steering_angle_rad > MAX_FIXED_ANGLE:
            what = f"must be at most {MAX_FIXED_ANGLE} where the fixed axle drives"
            yield ("steering_angle_rad",), what, self.steering_angle_rad


def steered_wheels(settings: TricycleDrive) -> BaseKinematics:
    """Return the kinematics of a tricycle base."""
    return SteeredWheels(
        settings.wheel_radius_m,
        settings.wheelbase_m,
        settings.traction == "steered",
        settings.steering_angle_rad,
        settings.steering_velocity_rad_s,
        settings.steering_acceleration_rad_s2,
        max(settings.acceleration_m_s2, settings.deceleration_m_s2),
        max(settings.angular_acceleration_rad_s2, settings.angular_deceleration_rad_s2),
    )


ACROSS = 1e-3  # cosine of an angle that counts as π/2
STRAIGHT_M_S = 1e-6  # speed of the steered wheel below which its direction means nothing
ARRIVED_RAD = 1e-9
STANDING = 1e-9  # change of the twist, m/s or rad/s per rad, that counts as none
WAIT_RAD = 0.3  # missing part of the angle above which the driven wheel waits


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
        steering_velocity, steering_acceleration: limits of the steering axis, rad/s and rad/s².
        linear_acceleration, angular_acceleration: limits of the base, m/s² and rad/s².
    """

    moves_sideways: ClassVar[bool] = False
    steered: ClassVar[tuple[int, ...]] = (1,)

    radius: float
    wheelbase: float
    drives_steered: bool
    largest_angle: float
    steering_velocity: float
    steering_acceleration: float
    linear_acceleration: float = math.inf
    angular_acceleration: float = math.inf

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

    def twist_by_angle(self, turn: float, angle: float) -> PlanarTwist:
        """Return the derivative of ``twist`` with respect to the angle, per rad."""
        rim = turn * self.radius
        if self.drives_steered:
            return PlanarTwist(-rim * math.sin(angle), rim * math.cos(angle) / self.wheelbase)
        return PlanarTwist(0.0, rim / math.cos(angle) ** 2 / self.wheelbase)

    def follower(
        self, angles: Sequence[float], acceleration: float, period_s: float
    ) -> WheelFollower:
        """Return the follower of a motion from the angle in ``angles``; any thread."""
        [angle] = angles
        return SteeringFollower(self, angle, acceleration, period_s)


class SteeringFollower:
    """Follows twists with angle and speed, one step a period. One thread.

    The driven wheel waits for the steering: the more of the angle is missing, the slower it turns,
    so that the base leaves the commanded arc as little as possible. Together they change the
    twist of the base within its accelerations. At a standstill the angle stays.

    Args:
        wheels: kinematics of the base.
        angle: at the start, rad; the wheel is at rest.
        acceleration: of the driven wheel, rad/s².
        period_s: of the control loop.

    Attributes:
        angle, rate: of steering, rad and rad/s.
        speed: of the driven wheel, rad/s.
    """

    def __init__(
        self, wheels: SteeredWheels, angle: float, acceleration: float, period_s: float
    ) -> None:
        self.angle, self.rate, self.speed = angle, 0.0, 0.0
        self._wheels, self._acceleration, self._period_s = wheels, acceleration, period_s
        self._target = angle
        self._limits = wheels.linear_acceleration, wheels.angular_acceleration

    @property
    def at_rest(self) -> bool:
        """True while nothing turns."""
        return self.speed == 0.0 and self.rate == 0.0

    @property
    def twist(self) -> PlanarTwist:
        """Twist of the base at this angle and speed."""
        return self._wheels.twist(self.speed, self.angle)

    @property
    def velocities(self) -> tuple[float, float]:
        """Angular velocities of the driven wheel and of steering, rad/s."""
        return self.speed, self.rate

    @property
    def angles(self) -> tuple[float]:
        """Steering angle, rad."""
        return (self.angle,)

    def step(self, twist: PlanarTwist) -> None:
        """Move on by one period towards ``twist``."""
        speed, target = self._wheels.speeds(twist)
        across = self._wheels.wheelbase * twist.angular
        if math.hypot(twist.linear, across) >= STRAIGHT_M_S:
            self._target = target
        self._steer()
        wanted = speed * max(0.0, 1.0 - abs(self._target - self.angle) / WAIT_RAD)
        low, high = self._accelerations()
        change = max(low * self._period_s, min(high * self._period_s, wanted - self.speed))
        self.speed += change

    def _accelerations(self) -> tuple[float, float]:
        """Return the least and the highest acceleration of the driven wheel, rad/s².

        What it and the steering change of the twist together is within the base's accelerations.
        """
        wheels, low, high = self._wheels, -self._acceleration, self._acceleration
        by_wheel = wheels.twist(1.0, self.angle)
        by_angle = wheels.twist_by_angle(self.speed, self.angle)
        for limit, wheel, angle in zip(self._limits, by_wheel, by_angle, strict=False):
            if wheel:
                ends = [(end - angle * self.rate) / wheel for end in (-limit, limit)]
                low, high = max(low, min(ends)), min(high, max(ends))
        return min(low, 0.0), max(high, 0.0)

    def _steer(self) -> None:
        """Turn towards the target, as fast as the axis can still stop there."""
        period_s, change = self._period_s, self._wheels.twist_by_angle(self.speed, self.angle)
        velocity = self._wheels.steering_velocity
        for limit, angle in zip(self._limits, change, strict=False):
            velocity = min(velocity, limit / max(abs(angle), STANDING))
        step, before = self._wheels.steering_acceleration * period_s, self.rate
        # In a period the rate changes evenly: its first half belongs to the rate before.
        missing = self._target - self.angle - 0.5 * before * period_s
        wanted = math.copysign(min(velocity, _stopping(abs(missing) / period_s, step)), missing)
        self.rate += max(-step, min(step, wanted - before))
        self.angle += 0.5 * (before + self.rate) * period_s
        if abs(self._target - self.angle) < ARRIVED_RAD and abs(self.rate) < ARRIVED_RAD:
            self.angle, self.rate = self._target, 0.0


def _stopping(distance: float, step: float) -> float:
    """Return the highest rate that stops within ``distance``, rad per period, by ``step`` a period.

    From rates of (whole and fraction) ``count`` steps, ``distance`` is the sum of the rates until
    rest.
    """
    count = math.floor((math.sqrt(1.0 + 8.0 * distance / step) - 1.0) / 2)
    return distance / (count + 1) + step * count / 2
