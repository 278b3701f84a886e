"""A command to one axis changes nothing of the others."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import Capability, CommandMode, FaultInjector
from robotd_conformance.checks.harness import SETTLED_RAD, Harness


def several(harness: Harness) -> Harness:
    if harness.count < 2:
        pytest.skip(f"the robot {harness.robot.descriptor.name} has one axis")
    return harness


@pytest.mark.clause("AxisDriver.set_command_mode/changes")
@pytest.mark.needs(Capability.VELOCITY_MODE)
def test_the_mode_of_one_axis(fresh: Harness) -> None:
    harness = several(fresh)
    for axis in harness.all[:2]:
        harness.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
        harness.periods(5)
        expected = np.where(
            np.arange(harness.count) <= axis, CommandMode.VELOCITY, CommandMode.POSITION
        )
        assert list(harness.image.mode) == list(expected)


@pytest.mark.clause("AxisDriver.set_polarity/sets")
@pytest.mark.needs(Capability.SCALING)
def test_the_polarity_of_one_axis(rescalable: Harness) -> None:
    harness = several(rescalable)
    for axis in harness.all:
        harness.robot.axes.set_polarity(axis, 1)
    harness.periods(5)
    expected = harness.image.position.copy()
    harness.robot.axes.set_polarity(1, -1)
    harness.periods(5)
    expected[1] *= -1.0
    assert harness.image.position == pytest.approx(expected, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.set_gear_ratio/counts")
@pytest.mark.needs(Capability.SCALING)
def test_the_gear_ratio_of_one_axis(rescalable: Harness) -> None:
    harness = several(rescalable)
    for axis in harness.all:
        harness.robot.axes.set_gear_ratio(axis, 2.0**18, 2.0 * np.pi)
    harness.periods(5)
    expected = harness.image.position.copy()
    harness.robot.axes.set_gear_ratio(1, 2.0**19, 2.0 * np.pi)
    harness.periods(5)
    expected[1] /= 2.0
    assert harness.image.position == pytest.approx(expected, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.home/no-motion")
@pytest.mark.clause("AxisDriver.home/zero", "AxisDriver.read/states")
@pytest.mark.needs(Capability.HOMING)
def test_the_home_position_of_one_axis(fresh: Harness) -> None:
    harness = several(fresh)
    harness.require_rescaling()
    harness.move_all()
    harness.rest()
    before, was_done = harness.image.position.copy(), harness.image.home_done.copy()
    if harness.can(Capability.SIMULATED):
        assert not was_done.any(), "home is done before homing"
    for axis in (1, 0, 1):
        harness.robot.axes.home(axis)
        harness.rest()
        before[axis], was_done[axis] = 0.0, True
        assert harness.image.position == pytest.approx(before, abs=SETTLED_RAD)
        assert list(harness.image.home_done) == list(was_done)


@pytest.mark.clause("AxisDriver.clear_alarm/clears")
def test_the_alarm_of_one_axis_is_cleared_alone(harness: Harness, injector: FaultInjector) -> None:
    several(harness)
    if harness.can(Capability.CONTROLLER_ALARM):
        pytest.skip(f"the {harness.robot.backend.name} backend has one alarm for all axes")
    for axis in (0, 1):
        injector.trip(axis, 0x32)
    harness.until(lambda: bool(harness.image.amp_alarm[:2].all()), "both alarms are shown", 1.0)
    harness.robot.axes.clear_alarm(0)
    harness.pass_time(0.3)
    assert list(harness.image.amp_alarm[:2]) == [False, True]
