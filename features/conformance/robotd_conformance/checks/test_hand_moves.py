"""Moves by hand: enabling keeps an axis where it was moved to, however little that is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robotd.api import FaultInjector, FloatArray, NotReady, RobotdError
from robotd_conformance.checks.hand import move_by_hand, require_smooth_begin, small_distances
from robotd_conformance.checks.harness import Harness

ALARM = 0x2310


def by_name(function: Callable[[Harness], None]) -> str:
    return function.__name__


def by_servo(harness: Harness) -> None:
    harness.disable()


def by_alarm(harness: Harness) -> None:
    for axis in harness.all:
        harness.injector.trip(axis, ALARM)
    harness.until(lambda: bool(harness.image.amp_alarm.all()), "the alarms are shown", 1.0)


@pytest.mark.clause("AxisDriver.servo/no-jump", "AxisDriver.move/starts")
@pytest.mark.parametrize("switch_off", [by_servo, by_alarm], ids=by_name)
def test_a_small_move_by_hand_is_kept_at_enabling(
    harness: Harness, injector: FaultInjector, switch_off: Callable[[Harness], None]
) -> None:
    for size in (0.0005, 0.001, 0.003, 0.01):
        switch_off(harness)
        harness.rest()
        delta = small_distances(harness, size)
        try:
            move_by_hand(harness, injector, delta)
        except NotReady:
            pytest.skip("an axis in alarm is held by its servo")
        harness.periods(5)
        require_no_return(harness, delta)
    require_smooth_begin(harness)


@pytest.mark.clause("AxisDriver.servo/no-jump", "AxisDriver.move/starts")
@pytest.mark.parametrize("close", [False, True], ids=["stopped", "closed"])
def test_a_move_by_hand_between_two_connections_is_kept_at_enabling(
    fresh: Harness, close: bool
) -> None:
    """Off zero, from where an axis may count in the next connection."""
    for size in (0.001, 0.01):
        delta = small_distances(fresh, size)
        fresh.move_all(0.3)
        fresh.rest()
        fresh.disable()
        (fresh.robot.connection.close if close else fresh.robot.connection.stop_communication)()
        try:
            move_by_hand(fresh, fresh.injector, delta)
        except (RobotdError, OSError):
            pytest.skip("the axes are simulated and end with the device")
        fresh.start(enable=False)
        require_no_return(fresh, delta)
        fresh.enable()
    require_smooth_begin(fresh)


def require_no_return(harness: Harness, delta: FloatArray) -> None:
    """Enable the axes, which were moved by ``delta``; raise AssertionError where one moves."""
    start = harness.image.position.copy()
    for axis in harness.all:
        harness.drivers.axes.clear_alarm(axis, 5.0)
        harness.drivers.axes.servo(axis, True, 5.0)
    with harness.recording() as recording:
        harness.pass_time(0.1)
    off = np.abs(recording.position_command - start).max(0)
    for axis in harness.all:
        assert off[axis] < 0.5 * abs(delta[axis]), (
            f"axis {axis} was moved by {delta[axis]:.2g} rad by hand; enabling has moved the"
            f" command {off[axis]:.2g} rad away from the measured position"
        )
