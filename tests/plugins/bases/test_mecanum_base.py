"""Mecanum base on the simulation, on a clock that the tests advance."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from tests.core.control.base_harness import BaseHarness, running

from robotd.descriptor import load_robot_descriptor
from robotd.device.axes import Jog
from robotd.errors import InvalidArgument, NotReady
from robotd.motion.planar import ZERO_TWIST, PlanarTwist
from robotd.motion.profile import Profile

RADIUS_M, LEVER_M = 0.076, 0.41
WHEELS = ("front left wheel", "front right wheel", "rear left wheel", "rear right wheel")


@pytest.fixture
def harness() -> Iterator[BaseHarness]:
    yield from running(load_robot_descriptor("mecanum_base"))


def test_every_wheel_turns_as_the_twist_needs_it(harness: BaseHarness) -> None:
    harness.drive(0.2, 0.4, 2.0, lateral=-0.3)
    turning = 0.4 * LEVER_M
    expected = [0.2 + 0.3 - turning, 0.2 - 0.3 + turning, 0.2 - 0.3 - turning, 0.2 + 0.3 + turning]
    measured = RADIUS_M * harness.robot.image.velocity
    assert measured == pytest.approx(expected, abs=1e-3)
    assert harness.twist == pytest.approx(PlanarTwist(0.2, 0.4, -0.3), abs=1e-3)


def test_a_diamond_closes_without_turning(harness: BaseHarness) -> None:
    for linear, lateral in ((0.3, 0.3), (-0.3, 0.3), (-0.3, -0.3), (0.3, -0.3)):
        harness.drive(linear, 0.0, 2.0, lateral)
        harness.drive(0.0, 0.0, 1.5)
    # A side is longer by some periods where the thread of the base was slow to claim the wheels.
    assert math.hypot(*harness.base.pose[:2]) < 0.01
    assert harness.base.pose.heading == pytest.approx(0.0, abs=1e-6)


def test_odometry_is_the_way_of_the_simulated_wheels(harness: BaseHarness) -> None:
    start = np.array([harness.wheel(axis) for axis in range(4)])
    harness.drive(0.0, 0.0, 0.1, lateral=0.4)
    harness.drive(0.0, 0.0, 0.1, lateral=0.4)
    harness.drive(0.0, 0.0, 2.0)
    turns = np.array([harness.wheel(axis) for axis in range(4)]) - start
    sideways = RADIUS_M / 4 * float(np.dot([-1, 1, 1, -1], turns))
    assert sideways > 0.02
    assert harness.base.pose == pytest.approx((0.0, sideways, 0.0), abs=1e-4)


def test_a_command_beyond_the_limits_keeps_its_direction(harness: BaseHarness) -> None:
    sent = []
    for _ in range(80):
        harness.drive(3.0, 1.5, 0.05, lateral=2.0)
        sent.append(harness.base.limited)
    fastest = 16.0 * RADIUS_M * 3.0 / (3.0 + 2.0 + 1.5 * LEVER_M)
    assert max(twist.linear for twist in sent) == pytest.approx(fastest)
    for twist in sent:
        assert twist == pytest.approx(PlanarTwist(3.0, 1.5, 2.0).scaled(twist.linear / 3.0))
    while harness.base.moving:
        harness.step()
        twist = harness.base.limited
        assert twist == pytest.approx(PlanarTwist(3.0, 1.5, 2.0).scaled(twist.linear / 3.0))
    assert harness.base.limited == ZERO_TWIST


def test_all_wheels_are_claimed_and_named(harness: BaseHarness) -> None:
    harness.drive(0.0, 0.0, 0.5, lateral=0.3)
    assert harness.robot.axes.names == WHEELS
    for axis, name in enumerate(WHEELS):
        with pytest.raises(NotReady, match=f"{name}: in use by mobile base"):
            harness.robot.axes.jog([Jog(axis, Profile(1.0, 5.0, 5.0))])


def test_a_servo_that_goes_off_stops_all_wheels(harness: BaseHarness) -> None:
    harness.drive(0.3, 0.0, 1.0, lateral=0.2)
    harness.robot.axes.servo(2, False)
    harness.step()
    harness.settle()
    harness.run(1.0)
    assert np.abs(harness.robot.image.velocity).max() < 1e-6


def test_a_differential_base_does_not_move_sideways() -> None:
    for harness in running(load_robot_descriptor("baymax")):
        with pytest.raises(
            InvalidArgument, match=r"0\.1 m/s to the left: the base cannot move sid"
        ):
            harness.base.command(0.0, 0.0, 0.1)
