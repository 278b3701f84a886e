"""Tricycle kinematics against the rolling constraints, limits of steering, and odometry."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotd.motion.dead_reckoning import Odometry
from robotd.motion.planar import ORIGIN, PlanarTwist, Pose
from robotd_bases.tricycle import SteeredWheels, SteeringFollower

RIGHT_ANGLE = math.pi / 2
PERIOD_S = 0.005
VELOCITY, ACCELERATION = 1.5, 6.0  # of steering
WHEEL_ACCELERATION = 20.0
linears = st.floats(0.01, 3.0) | st.floats(-3.0, -0.01)
angulars = st.floats(-3.0, 3.0)
twists = st.builds(PlanarTwist, linears, angulars, st.just(0.0))
lengths = st.floats(0.05, 2.0)
bases = st.builds(
    partial(
        SteeredWheels,
        largest_angle=RIGHT_ANGLE,
        steering_velocity=VELOCITY,
        steering_acceleration=ACCELERATION,
    ),
    radius=lengths,
    wheelbase=lengths,
    drives_steered=st.booleans(),
)
FRONT = SteeredWheels(0.1, 0.8, True, 1.2, VELOCITY, ACCELERATION)
REAR = SteeredWheels(0.1, 0.8, False, 1.2, VELOCITY, ACCELERATION)


@given(bases, twists)
def test_no_wheel_slips(base: SteeredWheels, twist: PlanarTwist) -> None:
    """The velocity of each contact point is that of the rim, and nothing across the wheel."""
    speed, angle = base.speeds(twist)
    ahead, across = twist.linear, twist.angular * base.wheelbase  # at the steered wheel
    along = ahead * math.cos(angle) + across * math.sin(angle)
    sideways = across * math.cos(angle) - ahead * math.sin(angle)
    assert sideways == pytest.approx(0.0, abs=1e-9)
    rim = along if base.drives_steered else twist.linear  # the fixed axle is at the origin
    assert speed * base.radius == pytest.approx(rim, rel=1e-9, abs=1e-9)


@given(bases, twists)
def test_a_twist_comes_back(base: SteeredWheels, twist: PlanarTwist) -> None:
    assert base.twist(*base.speeds(twist)) == pytest.approx(twist, rel=1e-6, abs=1e-9)


@given(bases, twists)
def test_no_rim_is_faster_than_the_lever_says(base: SteeredWheels, twist: PlanarTwist) -> None:
    bound = abs(twist.linear) + base.lever * abs(twist.angular)
    assert abs(base.speeds(twist)[0]) * base.radius <= bound * (1.0 + 1e-9)


def test_a_driven_wheel_that_stands_across_turns_the_base_on_the_spot() -> None:
    base = SteeredWheels(0.1, 0.8, True, RIGHT_ANGLE, VELOCITY, ACCELERATION)
    assert base.speeds(PlanarTwist(0.0, 0.5)) == pytest.approx((4.0, RIGHT_ANGLE))
    assert base.turns_on_the_spot
    assert not FRONT.turns_on_the_spot
    assert not REAR.turns_on_the_spot


@pytest.mark.parametrize("base", [FRONT, REAR])
@pytest.mark.parametrize("linear", [0.2, -0.2])
def test_beyond_the_largest_angle_the_linear_speed_is_kept(
    base: SteeredWheels, linear: float
) -> None:
    speed, angle = base.speeds(PlanarTwist(linear, 2.0))
    assert angle == math.copysign(1.2, linear)
    found = base.twist(speed, angle)
    assert found.linear == pytest.approx(linear)
    assert 0.0 < found.angular < 2.0


def test_at_a_standstill_the_angle_is_zero_and_nothing_turns() -> None:
    assert FRONT.speeds(PlanarTwist(0.0, 0.0)) == (0.0, 0.0)
    assert REAR.speeds(PlanarTwist(0.0, 1.0))[0] == 0.0


def follow(follower: SteeringFollower, twist: PlanarTwist, seconds: float) -> list[PlanarTwist]:
    """Steps towards a twist; every one is within the limits of both axes."""
    found = []
    for _ in range(round(seconds / PERIOD_S)):
        angle, rate, speed = follower.angle, follower.rate, follower.speed
        follower.step(twist)
        assert abs(follower.rate) <= VELOCITY * (1 + 1e-9)
        assert abs(follower.angle - angle) <= VELOCITY * PERIOD_S * (1 + 1e-9)
        assert abs(follower.rate - rate) <= ACCELERATION * PERIOD_S * 1.01
        # A drive that passes through angle and rate keeps to the acceleration between them, too.
        turned = (rate + follower.rate) / 2 * PERIOD_S
        assert follower.angle - angle == pytest.approx(turned, abs=2e-9)
        assert abs(follower.speed - speed) <= WHEEL_ACCELERATION * PERIOD_S * (1 + 1e-9)
        found.append(follower.twist)
    return found


@settings(max_examples=15)
@given(linears, angulars, linears, angulars)
def test_both_axes_keep_their_limits_and_arrive(
    linear: float, angular: float, other: float, turning: float
) -> None:
    follower = SteeringFollower(FRONT, 0.0, WHEEL_ACCELERATION, PERIOD_S)
    for twist in (PlanarTwist(linear, angular), PlanarTwist(other, turning)):
        follow(follower, twist, 8.0)
        speed, angle = FRONT.speeds(twist)
        assert follower.angle == pytest.approx(angle, abs=1e-3)
        assert follower.speed == pytest.approx(speed, abs=1e-2 * max(1.0, abs(speed)))


LIMITED = [
    replace(follower_settings, linear_acceleration=1.0, angular_acceleration=2.0)
    for follower_settings in (FRONT, REAR)
]


@pytest.mark.parametrize("base", LIMITED)
@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.floats(-1.2, 1.2), st.floats(-1.5, 1.5)), min_size=3, max_size=5))
def test_wheel_and_steering_keep_the_accelerations_of_the_base(
    base: SteeredWheels, twists: list[tuple[float, float]]
) -> None:
    """Both together: they changed the speed of the base by 2.7 m/s² and 4.2 rad/s²."""
    follower = SteeringFollower(base, 0.0, WHEEL_ACCELERATION, PERIOD_S)
    found = [follower.twist]
    for linear, angular in twists:
        found += follow(follower, PlanarTwist(linear, angular), 1.5)
    changes = np.diff(np.array(found)[:, :2], axis=0) / PERIOD_S
    assert (np.abs(changes).max(axis=0) < [1.05, 2.1]).all()


def test_the_wheel_waits_for_the_steering() -> None:
    follower = SteeringFollower(FRONT, 0.0, WHEEL_ACCELERATION, PERIOD_S)
    for twist in follow(follower, PlanarTwist(0.2, 0.5), 3.0):
        if abs(twist.linear) > 0.15:
            assert twist.angular / twist.linear == pytest.approx(2.5, rel=0.25)
    follow(follower, PlanarTwist(0.2, 0.5), 1.0)
    arc = [twist.angular / twist.linear for twist in follow(follower, PlanarTwist(0.1, 0.25), 0.5)]
    assert arc == pytest.approx([2.5] * len(arc))


def test_a_stop_keeps_the_angle() -> None:
    follower = SteeringFollower(FRONT, 0.0, WHEEL_ACCELERATION, PERIOD_S)
    follow(follower, PlanarTwist(0.3, 0.3), 3.0)
    angle = follower.angle
    follow(follower, PlanarTwist(0.0, 0.0), 2.0)
    assert follower.at_rest
    assert follower.angle == angle


@pytest.mark.parametrize("base", [FRONT, REAR])
def test_a_quarter_turn_ends_where_the_circle_says(base: SteeredWheels) -> None:
    radius, steps = 2.0, 400
    speed, angle = base.speeds(PlanarTwist(1.0, 1.0 / radius))
    odometry = Odometry(base)
    quarter_s = RIGHT_ANGLE * radius
    for step in range(steps + 1):
        odometry.update([speed * quarter_s * step / steps, angle])
    assert odometry.pose == pytest.approx(Pose(radius, radius, RIGHT_ANGLE))


def test_steering_at_a_standstill_moves_nothing() -> None:
    odometry = Odometry(FRONT)
    assert all(odometry.update([3.0, angle], 0.01) for angle in (0.0, 0.5, 1.0))
    assert odometry.pose == ORIGIN
