"""Home, polarity and gear ratio: set repeatedly, axis by axis, servo off."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import Capability, OperationError
from robotd_conformance.checks.harness import SETTLED_RAD, STANDSTILL_RAD_S, Harness

COUNTS = 2.0**18
TURN = 2.0 * np.pi


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.needs(Capability.HOMING)
@pytest.mark.clause("AxisDriver.home/zero", "AxisDriver.home/waits", "AxisDriver.home/no-motion")
def test_homing_again_makes_the_new_position_zero(fresh: Harness) -> None:
    fresh.require_rescaling()
    last = fresh.count - 1
    limits = fresh.robot.axes.limits[last]
    if not limits.lower < 0.0 < limits.upper:
        pytest.skip("the new position would be outside the limits of the last axis")
    for share in (0.5, -0.3):
        fresh.move_all(share)
        fresh.rest()
        others = fresh.image.position[:last].copy()
        fresh.drivers.axes.home(last, 10.0)
        fresh.periods(2)
        assert fresh.image.home_done[last], "home returned before homing was done"
        assert abs(fresh.image.position[last]) <= SETTLED_RAD, "homing had no effect"
        assert fresh.image.position[:last] == pytest.approx(others, abs=SETTLED_RAD)
        fresh.pass_time(0.3)
        assert abs(fresh.image.position[last]) <= SETTLED_RAD, "the axis moved"
        assert np.abs(fresh.image.velocity).max() < STANDSTILL_RAD_S
    targets = fresh.image.position_command.copy()
    targets[last] += fresh.travel(0.3)[last]
    fresh.move([last], targets)
    fresh.rest()
    assert not fresh.off_target(targets)


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/sets", "AxisDriver.set_polarity/measured")
def test_polarity_is_set_and_not_toggled(rescalable: Harness) -> None:
    axes, last = rescalable.robot.axes, rescalable.count - 1
    for axis in rescalable.all:
        axes.set_polarity(axis, 1)
    rescalable.periods(5)
    plain = rescalable.image.position.copy()
    for polarity in (1, -1, -1, 1, 1, -1, 1):
        axes.set_polarity(last, polarity)
        rescalable.periods(5)
        expected = plain.copy()
        expected[last] *= polarity
        assert rescalable.image.position == pytest.approx(expected, abs=SETTLED_RAD)


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/measured", "AxisDriver.move/target")
def test_a_turned_axis_goes_where_it_is_commanded(rescalable: Harness) -> None:
    last, limits = rescalable.count - 1, rescalable.robot.axes.limits
    for polarity in (-1, 1):
        rescalable.robot.axes.set_polarity(last, polarity)
        rescalable.periods(5)
        inside = rescalable.image.position[last] + 0.1 < limits[last].upper
        if not limits[last].lower < rescalable.image.position[last] - 0.1 or not inside:
            pytest.skip("the turned position is outside of the limits")
        rescalable.robot.axes.servo(last, True)
        targets = rescalable.image.position_command.copy()
        for distance in (0.05, -0.05):
            targets[last] += distance
            with rescalable.recording() as recording:
                rescalable.move([last], targets)
                rescalable.rest([last])
            for speeds in (recording.velocity, recording.velocity_command):
                fastest = speeds[np.abs(speeds[:, last]).argmax(), last]
                assert np.sign(fastest) == np.sign(distance), "a velocity has the wrong sign"
            assert rescalable.image.position[last] == pytest.approx(targets[last], abs=SETTLED_RAD)
        rescalable.robot.axes.servo(last, False)
        rescalable.rest()


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_gear_ratio/counts")
def test_a_gear_ratio_is_a_fraction(rescalable: Harness) -> None:
    axes, last = rescalable.robot.axes, rescalable.count - 1
    axes.set_gear_ratio(last, COUNTS, TURN)
    rescalable.periods(5)
    one = rescalable.image.position.copy()
    for numerator, denominator in (
        (COUNTS, TURN),
        (2.0 * COUNTS, TURN),
        (COUNTS, 2.0 * TURN),
        (COUNTS, 2.0 * TURN),
        (3.0 * COUNTS, 2.0 * TURN),
        (COUNTS / TURN, 1.0),
        (0.375 * COUNTS / TURN, 0.375),
        (COUNTS, TURN),
    ):
        axes.set_gear_ratio(last, numerator, denominator)
        rescalable.periods(5)
        expected = one.copy()
        expected[last] *= (COUNTS / numerator) * (denominator / TURN)
        assert rescalable.image.position == pytest.approx(expected, abs=SETTLED_RAD)


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/servo-off", "AxisDriver.set_gear_ratio/servo-off")
def test_the_scale_of_an_enabled_axis_is_not_changed(fresh: Harness) -> None:
    fresh.require_rescaling()
    before, driver = fresh.image.position.copy(), fresh.drivers.axes
    for axis in (0, fresh.count - 1):
        with pytest.raises(OperationError):
            driver.set_polarity(axis, -1)
        with pytest.raises(OperationError):
            driver.set_gear_ratio(axis, 3.0 * COUNTS, TURN)
    fresh.pass_time(0.2)
    assert fresh.image.position == pytest.approx(before, abs=SETTLED_RAD)
    assert fresh.image.servo_on.all()
