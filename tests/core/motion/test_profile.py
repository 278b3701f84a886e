from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.motion.profile import (
    Profile,
    Segment,
    profile_to_position,
    profile_to_rest,
    profile_to_velocity,
)

positions = st.floats(-10, 10)
velocities = st.floats(-5, 5)
rates = st.floats(0.1, 100)
profiles = st.builds(Profile, st.floats(0.01, 5), rates, rates)


def assert_continuous(plan: list[Segment], position: float, velocity: float) -> None:
    assert plan[0].start_s == 0
    assert plan[0].at(0) == pytest.approx((position, velocity), abs=1e-9)
    for segment, following in pairwise(plan):
        there = following.position, following.velocity
        assert segment.at(following.start_s) == pytest.approx(there, abs=1e-6)


@given(positions, velocities, positions, profiles)
def test_a_move_lands_exactly_within_its_limits(
    position: float, velocity: float, target: float, profile: Profile
) -> None:
    plan = profile_to_position(position, velocity, target, profile, profile.deceleration)
    assert_continuous(plan, position, velocity)
    assert plan[-1] == Segment(plan[-1].start_s, target, 0.0, 0.0)
    rate = max(profile.acceleration, profile.deceleration)
    for segment in plan:
        assert abs(segment.velocity) <= max(abs(velocity), profile.velocity) + 1e-7
        assert abs(segment.acceleration) <= rate * (1 + 1e-9)


@given(positions, positions, profiles)
def test_a_move_from_rest_never_turns_back(start: float, target: float, profile: Profile) -> None:
    side = 1 if target >= start else -1
    for segment in profile_to_position(start, 0.0, target, profile, profile.deceleration):
        assert side * segment.velocity >= -1e-7


@given(positions, velocities, velocities, rates, rates)
def test_a_velocity_command_reaches_its_velocity_and_keeps_it(
    position: float, velocity: float, target: float, acceleration: float, deceleration: float
) -> None:
    plan = profile_to_velocity(position, velocity, target, acceleration, deceleration)
    assert_continuous(plan, position, velocity)
    assert plan[-1].velocity == target
    assert plan[-1].acceleration == 0


def test_a_trapezoid_takes_the_time_of_the_textbook() -> None:
    plan = profile_to_position(0.0, 0.0, 3.0, Profile(2.0, 8.0, 4.0), 4.0)
    # 0.25 s and 0.5 s of ramps over 0.75 rad, the rest at 2 rad/s
    assert plan[-1].start_s == pytest.approx(0.25 + (3.0 - 0.75) / 2.0 + 0.5)


def test_acceleration_speeds_up_and_deceleration_slows_down_in_both_directions() -> None:
    for side in (1.0, -1.0):
        up = profile_to_velocity(0.0, side, 3 * side, acceleration=4.0, deceleration=10.0)
        down = profile_to_velocity(0.0, 3 * side, side, acceleration=4.0, deceleration=10.0)
        through = profile_to_velocity(0.0, -side, side, acceleration=4.0, deceleration=10.0)
        assert up[-1].start_s == pytest.approx(0.5)
        assert down[-1].start_s == pytest.approx(0.2)
        assert through[-1].start_s == pytest.approx(0.1 + 0.25)


def test_a_stop_takes_the_time_and_distance_of_physics() -> None:
    end = profile_to_rest(1.0, -2.0, 4.0)[-1]
    assert end.start_s == pytest.approx(0.5)
    assert end.position == pytest.approx(1.0 - 0.5)
    assert end.velocity == 0


def test_a_target_too_near_is_reached_by_braking_harder_or_by_coming_back() -> None:
    profile = Profile(2.0, 4.0, 4.0)  # stops within 0.5
    harder = profile_to_position(0.0, 2.0, 0.25, profile, max_deceleration=100.0)
    assert [segment.acceleration for segment in harder] == pytest.approx([-8.0, 0.0])
    back = profile_to_position(0.0, 2.0, 0.25, profile, max_deceleration=4.0)
    assert max(segment.position for segment in back) == pytest.approx(0.5)
    assert back[-1].position == 0.25
