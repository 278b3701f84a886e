"""Skid-steer base on the simulation, on a clock that the tests advance."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from tests.core.control.base_harness import BaseHarness, running

from robotd.descriptor import load_robot_descriptor
from robotd.device.axes import Jog
from robotd.errors import NotReady
from robotd.motion.profile import Profile

RADIUS_M, TRACK_M = 0.165, 0.57 * 1.5
WHEELS = ("left wheel 1", "left wheel 2", "right wheel 1", "right wheel 2")


@pytest.fixture
def harness() -> Iterator[BaseHarness]:
    yield from running(load_robot_descriptor("skid_steer_base"))


def test_all_wheels_of_a_side_get_one_speed(harness: BaseHarness) -> None:
    harness.drive(0.3, 0.4, 2.0)
    left, right = 0.3 - 0.4 * TRACK_M / 2, 0.3 + 0.4 * TRACK_M / 2
    command = RADIUS_M * harness.robot.image.velocity_command
    assert command == pytest.approx([left, left, right, right], abs=1e-6)
    assert RADIUS_M * harness.robot.image.velocity == pytest.approx(command, abs=1e-3)
    assert harness.twist[:2] == pytest.approx((0.3, 0.4), abs=2e-3)


def test_odometry_is_the_mean_of_each_side(harness: BaseHarness) -> None:
    start = np.array([harness.wheel(axis) for axis in range(4)])
    harness.drive(0.3, 0.0, 1.0)
    harness.simulation.servo.position[1] -= 0.2  # one wheel of the left side fell back
    harness.drive(0.3, 0.0, 1.0)
    harness.drive(0.0, 0.0, 2.0)
    left, right = (
        RADIUS_M * np.mean(turns)
        for turns in np.split(np.array([harness.wheel(axis) for axis in range(4)]) - start, 2)
    )
    assert harness.base.pose.heading == pytest.approx((right - left) / TRACK_M, abs=1e-4)
    driven = math.hypot(*harness.base.pose[:2])
    assert driven == pytest.approx((left + right) / 2, rel=1e-3)


def test_all_wheels_are_claimed_and_named(harness: BaseHarness) -> None:
    harness.drive(0.2, 0.0, 0.5)
    assert harness.robot.axes.names == WHEELS
    for axis, name in enumerate(WHEELS):
        with pytest.raises(NotReady, match=f"{name}: in use by mobile base"):
            harness.robot.axes.jog([Jog(axis, Profile(1.0, 5.0, 5.0))])


@pytest.mark.parametrize("axis", range(4))
def test_a_servo_that_goes_off_stops_all_wheels(harness: BaseHarness, axis: int) -> None:
    harness.drive(0.3, 0.0, 1.0)
    harness.robot.axes.servo(axis, False)
    harness.step()
    harness.settle()
    harness.run(1.0)
    assert np.abs(harness.robot.image.velocity).max() < 1e-6
