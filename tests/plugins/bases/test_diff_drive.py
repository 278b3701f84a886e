"""Kinematics there and back, and arcs against plain numerical integration."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.motion.dead_reckoning import Odometry
from robotd.motion.planar import ORIGIN, ZERO_TWIST, PlanarTwist, Pose, along_arc
from robotd_bases.diff_drive import TwoSidedWheels

BAYMAX = TwoSidedWheels(0.09, separation=0.55)

speeds = st.floats(-10.0, 10.0)
twists = st.builds(PlanarTwist, speeds, speeds, st.just(0.0))
lengths = st.floats(0.01, 2.0)
factors = st.floats(0.5, 2.0)


def integrated(displacement: PlanarTwist, steps: int = 20_000) -> Pose:
    """The pose after ``displacement`` by the midpoint rule, whose error is below 1e-8 here."""
    headings = (np.arange(steps) + 0.5) / steps * displacement.angular
    cosine, sine = float(np.cos(headings).mean()), float(np.sin(headings).mean())
    return Pose(
        displacement.linear * cosine - displacement.lateral * sine,
        displacement.linear * sine + displacement.lateral * cosine,
        displacement.angular,
    )


def test_wheel_speeds_of_the_reference() -> None:
    left, right = BAYMAX.speeds(PlanarTwist(0.5, 1.0))
    assert left == pytest.approx((2 * 0.5 - 1.0 * 0.55) / (2 * 0.09))
    assert right == pytest.approx((2 * 0.5 + 1.0 * 0.55) / (2 * 0.09))


@given(st.builds(TwoSidedWheels, lengths, lengths, factors, factors), twists)
def test_a_twist_comes_back_from_its_wheel_speeds(
    wheels: TwoSidedWheels, twist: PlanarTwist
) -> None:
    assert wheels.twist(*wheels.speeds(twist)) == pytest.approx(twist, rel=1e-9, abs=1e-9)


def test_a_larger_right_wheel_turns_slower_and_its_odometry_turns_left() -> None:
    wheels = TwoSidedWheels(0.1, 0.5, left_multiplier=1.0, right_multiplier=1.25)
    assert wheels.speeds(PlanarTwist(1.0, 0.0)) == pytest.approx((10.0, 8.0))
    assert wheels.twist(1.0, 1.0) == pytest.approx(PlanarTwist(0.1125, 0.05))


def test_all_wheels_of_a_side_turn_alike_and_count_by_their_mean() -> None:
    pair, wheels = TwoSidedWheels(0.1, 0.5), TwoSidedWheels(0.1, 0.5, per_side=3)
    left, right = pair.speeds(PlanarTwist(1.0, 0.4))
    assert wheels.speeds(PlanarTwist(1.0, 0.4)) == (left, left, left, right, right, right)
    assert wheels.twist(1.0, 2.0, 3.0, 4.0, 4.0, 7.0) == pytest.approx(pair.twist(2.0, 5.0))


@given(st.floats(-5.0, 5.0), st.floats(-math.pi, math.pi), st.floats(-5.0, 5.0))
def test_an_arc_is_what_numerical_integration_approaches(
    length: float, angle: float, aside: float
) -> None:
    displacement = PlanarTwist(length, angle, aside)
    end = along_arc(ORIGIN, displacement)
    assert end[:2] == pytest.approx(integrated(displacement)[:2], abs=1e-7)
    assert math.remainder(end.heading - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(-1e-3, 1e-3))
def test_an_almost_straight_arc_loses_no_digits(angle: float) -> None:
    end = along_arc(ORIGIN, PlanarTwist(1.0, angle))
    assert end.x == pytest.approx(1.0 - angle**2 / 6, rel=1e-13)
    assert end.y == pytest.approx(angle / 2 - angle**3 / 24, rel=1e-11, abs=1e-300)


@given(twists, st.integers(1, 50))
def test_steps_along_an_arc_are_the_whole_arc(displacement: PlanarTwist, steps: int) -> None:
    pose = ORIGIN
    for _ in range(steps):
        pose = along_arc(
            pose, PlanarTwist(displacement.linear / steps, displacement.angular / steps)
        )
    whole = along_arc(ORIGIN, displacement)
    assert pose[:2] == pytest.approx(whole[:2], abs=1e-10)
    assert math.remainder(pose.heading - whole.heading, 2 * math.pi) == pytest.approx(0, abs=1e-10)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_the_pose_starts_at_zero_whatever_the_encoders_say(left: float, right: float) -> None:
    odometry = Odometry(BAYMAX)
    assert odometry.update((left, right))
    assert odometry.pose == ORIGIN
    assert odometry.update((left + 1.0, right + 1.0))
    assert odometry.pose == pytest.approx(Pose(0.09, 0.0, 0.0), abs=1e-9)


@given(
    st.floats(0.5, 100.0),
    st.lists(st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)), max_size=50),
)
def test_wheels_that_wrap_lead_where_unwrapped_ones_do(
    wrap: float, steps: list[tuple[float, float]]
) -> None:
    wrapping, plain = Odometry(BAYMAX, wrap), Odometry(BAYMAX)
    left = right = 0.0
    for left_step, right_step in [(0.0, 0.0), *steps]:
        left, right = left + left_step, right + right_step
        plain.update((left, right))
        wrapping.update((left % wrap, right % wrap))
    assert wrapping.pose == pytest.approx(plain.pose, abs=1e-9)


def test_a_renumbered_wheel_is_a_new_baseline_and_no_motion() -> None:
    odometry = Odometry(BAYMAX)
    odometry.update((0.0, 0.0))
    odometry.update((0.5, 0.5), longest_step=1.0)
    pose = odometry.pose
    assert not odometry.update((-80.0, 0.5), longest_step=1.0)
    assert odometry.pose == pose
    assert odometry.update((-79.5, 1.0), longest_step=1.0)
    assert odometry.pose.x == pytest.approx(2 * pose.x)


def test_rebase_keeps_the_pose_and_reset_the_baseline() -> None:
    odometry = Odometry(BAYMAX)
    odometry.update((0.0, 0.0))
    odometry.update((1.0, 2.0))
    pose = odometry.pose
    odometry.rebase()
    odometry.update((50.0, 60.0))
    assert odometry.pose == pose
    odometry.reset()
    assert odometry.pose == ORIGIN
    odometry.update((51.0, 61.0))
    assert odometry.pose == pytest.approx(Pose(0.09, 0.0, 0.0))


def test_many_turns_leave_the_heading_in_its_range() -> None:
    odometry = Odometry(BAYMAX)
    for step in range(10_000):
        odometry.update((-0.5 * step, 0.5 * step))
        assert -math.pi <= odometry.pose.heading <= math.pi
    turned = BAYMAX.twist(-0.5 * 9_999, 0.5 * 9_999).angular
    assert math.remainder(odometry.pose.heading - turned, 2 * math.pi) == pytest.approx(0, abs=1e-8)
    assert odometry.pose[:2] == pytest.approx(ZERO_TWIST[:2], abs=1e-12)
