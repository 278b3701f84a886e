"""Mecanum kinematics against the wheels' geometry, there and back, and its odometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.motion.dead_reckoning import Odometry
from robotd.motion.planar import ORIGIN, ZERO_TWIST, PlanarTwist, Pose
from robotd_bases.mecanum import MecanumWheels

speeds = st.floats(-10.0, 10.0)
twists = st.builds(PlanarTwist, speeds, speeds, speeds)
lengths = st.floats(0.01, 2.0)
bases = st.builds(MecanumWheels, lengths, lengths, lengths)

# x and y of the wheels in halves of wheelbase and track, and the direction of the roller's axis
# on the ground: the rollers that touch the ground form an O, those seen from above an X.
PLACES = ((1, 1, (1, -1)), (1, -1, (1, 1)), (-1, 1, (1, 1)), (-1, -1, (1, -1)))


def by_rollers(base: MecanumWheels, twist: PlanarTwist) -> list[float]:
    """Wheel speeds by the constraint of each contact point.

    A roller turns freely about its axis, so only the velocity along that axis passes from the
    ground to the wheel: axis . (v + w x place) = axis . (radius speed, 0).
    """
    found = []
    for ahead, left, axis in PLACES:
        x, y = ahead * base.wheelbase / 2, left * base.separation / 2
        contact = (twist.linear - twist.angular * y, twist.lateral + twist.angular * x)
        found.append(float(np.dot(axis, contact)) / (axis[0] * base.radius))
    return found


@given(bases, twists)
def test_wheel_speeds_fulfil_the_constraints_of_the_rollers(
    base: MecanumWheels, twist: PlanarTwist
) -> None:
    assert base.speeds(twist) == pytest.approx(by_rollers(base, twist), rel=1e-9, abs=1e-7)


@given(bases, twists)
def test_a_twist_comes_back_from_its_wheel_speeds(base: MecanumWheels, twist: PlanarTwist) -> None:
    assert base.twist(*base.speeds(twist)) == pytest.approx(twist, rel=1e-9, abs=1e-9)


@given(bases, st.tuples(speeds, speeds, speeds, speeds))
def test_slipping_wheels_give_the_least_squares_twist(
    base: MecanumWheels, turns: tuple[float, float, float, float]
) -> None:
    matrix = np.array([base.speeds(PlanarTwist(*unit)) for unit in np.eye(3)]).T
    best = np.linalg.lstsq(matrix, np.array(turns), rcond=None)[0]
    assert base.twist(*turns) == pytest.approx(best, rel=1e-9, abs=1e-9)


@given(bases, twists)
def test_the_rims_are_as_fast_as_radius_and_lever_say(
    base: MecanumWheels, twist: PlanarTwist
) -> None:
    rim = abs(twist.linear) + abs(twist.lateral) + base.lever * abs(twist.angular)
    fastest = base.radius * max(map(abs, base.speeds(twist)))
    assert fastest == pytest.approx(rim, rel=1e-9, abs=1e-12)


def test_signs_of_the_wheels() -> None:
    base = MecanumWheels(0.1, 0.4, 0.6)
    assert base.speeds(PlanarTwist(1.0, 0.0)) == pytest.approx((10.0, 10.0, 10.0, 10.0))
    assert base.speeds(PlanarTwist(0.0, 0.0, 1.0)) == pytest.approx((-10.0, 10.0, 10.0, -10.0))
    assert base.speeds(PlanarTwist(0.0, 1.0)) == pytest.approx((-5.0, 5.0, -5.0, 5.0))


def test_odometry_of_a_sideways_circle() -> None:
    """Sideways around a point ahead: a turn to the left with the nose towards the middle."""
    base = MecanumWheels(0.1, 0.4, 0.6)
    odometry = Odometry(base)
    radius, steps = 2.0, 100
    twist = PlanarTwist(0.0, -2 * math.pi / steps, 2 * math.pi * radius / steps)
    turns = np.zeros(4)
    assert odometry.update(turns.tolist())
    for step in range(1, steps + 1):
        turns = turns + base.speeds(twist)
        assert odometry.update(turns.tolist())
        angle = 2 * math.pi * step / steps
        place = Pose(radius - radius * math.cos(angle), radius * math.sin(angle), 0.0)
        assert odometry.pose[:2] == pytest.approx(place[:2], abs=1e-9)
    assert odometry.pose == pytest.approx(ORIGIN, abs=1e-9)


def test_at_rest_no_wheel_turns() -> None:
    assert MecanumWheels(0.1, 0.4, 0.6).speeds(ZERO_TWIST) == (0.0, 0.0, 0.0, 0.0)
