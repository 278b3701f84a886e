"""Limit and home switches: shown on their own axis, as long as they are closed."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from robotd.api import BoolArray, FaultInjector, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

SWITCHES = ("negative_limit", "positive_limit", "home_switch")
WAIT_S = 2.0  # until a switch is shown, on any fieldbus


def levels(image: ProcessImage) -> BoolArray:
    """(3, n_axes) levels in the order of ``SWITCHES``."""
    return np.array([getattr(image, switch) for switch in SWITCHES])


def shows(harness: Harness, switch: str, axis: int, closed: bool) -> bool:
    return bool(getattr(harness.image, switch)[axis]) is closed


@pytest.mark.clause("FaultInjector.press_switch/switch")
@pytest.mark.clause("AxisDriver.read/switches")
@pytest.mark.parametrize("switch", SWITCHES)
def test_a_closed_switch_is_shown_alone_until_it_is_released(
    harness: Harness, injector: FaultInjector, switch: str
) -> None:
    for axis in harness.all[:2]:
        name, before = f"the {switch} of axis {axis}", levels(harness.image)
        expected = before.copy()
        expected[SWITCHES.index(switch), axis] = True
        injector.press_switch(axis, switch, True)
        harness.until(partial(shows, harness, switch, axis, True), f"{name} is shown", WAIT_S)
        harness.pass_time(0.3)
        assert (levels(harness.image) == expected).all(), f"more than {name}"
        injector.press_switch(axis, switch, False)
        harness.until(partial(shows, harness, switch, axis, False), f"{name} is open", WAIT_S)
        assert (levels(harness.image) == before).all()


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.parametrize("switch", SWITCHES)
def test_a_switch_moves_no_axis_and_defines_no_home(
    harness: Harness, injector: FaultInjector, switch: str
) -> None:
    start, was_homed = harness.image.position.copy(), harness.image.home_done.copy()
    injector.press_switch(0, switch, True)
    harness.pass_time(0.3)
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD
    assert (harness.image.home_done == was_homed).all()
    injector.press_switch(0, switch, False)
    harness.pass_time(0.1)


@pytest.mark.clause("AxisDriver.read/switches")
def test_a_switch_that_is_closed_at_the_start_is_shown(disabled: Harness) -> None:
    disabled.robot.connection.stop_communication()
    disabled.injector.press_switch(0, "negative_limit", True)
    disabled.robot.connection.start_communication()
    disabled.until(lambda: disabled.robot.connection.ready, "the engine is ready again")
    disabled.until(
        lambda: disabled.image.negative_limit[0], "a switch that was closed before is shown"
    )
