"""Enabling and disabling: without a jump, only the axis that is meant, and truthfully."""

from __future__ import annotations

from contextlib import nullcontext, suppress

import numpy as np
import pytest

from robotd.api import (
    DeviceTimeout,
    FaultInjector,
    NotReady,
    OperationError,
    ProcessImage,
    Profile,
    RobotdError,
)
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

JUMP = 2.0
"""Part of a profile's velocity: a servo that polls its targets overshoots by up to a half."""
ALARM = 0x2310
TOO_SHORT_S = 1e-6  # for any drive to confirm anything


@pytest.mark.clause("AxisDriver.servo/no-jump")
def test_enabling_does_not_move_the_axis(harness: Harness) -> None:
    harness.disable()
    harness.rest()
    start = harness.image.position.copy()
    with harness.recording() as recording:
        harness.enable()
        harness.pass_time(0.3)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.servo/no-jump", "AxisDriver.servo/switches")
def test_enabling_after_a_move_by_hand_does_not_jump(
    harness: Harness, injector: FaultInjector
) -> None:
    harness.disable()
    harness.rest()
    for axis, delta in zip(harness.all, harness.travel(), strict=True):
        injector.move_by_hand(axis, float(delta))
    harness.periods(5)
    start = harness.image.position.copy()
    with harness.recording() as recording:
        harness.enable()
        harness.pass_time(0.3)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD
    enabled = recording.servo_on.astype(bool)
    jump = np.abs(recording.position_command - recording.position)[enabled]
    assert jump.max() <= SETTLED_RAD, "the command was not set to the measured position"


@pytest.mark.clause("AxisDriver.read/measured", "FaultInjector.move_by_hand/stays")
def test_a_move_by_hand_is_seen(harness: Harness, injector: FaultInjector) -> None:
    harness.disable()
    harness.rest()
    start, delta = harness.image.position.copy(), harness.travel(0.5)
    for axis in harness.all:
        injector.move_by_hand(axis, float(delta[axis]))
    harness.periods(5)
    assert harness.image.position == pytest.approx(start + delta, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.servo/waits")
def test_servo_returns_when_the_drive_says_so(harness: Harness) -> None:
    driver = harness.drivers.axes
    for on in (False, True, True, False, False, True):
        for axis in harness.all:
            driver.servo(axis, on, 5.0)
        harness.periods(2)
        assert (harness.image.servo_on == on).all()


@pytest.mark.clause("AxisDriver.servo/switches")
def test_only_the_named_servo_is_switched(harness: Harness) -> None:
    for axis in harness.all:
        harness.robot.axes.servo(axis, False)
        harness.periods(3)
        group = harness.servo_group(axis)
        assert not harness.image.servo_on[group].any()
        assert np.delete(harness.image.servo_on, group).all()
        harness.robot.axes.servo(axis, True)


@pytest.mark.clause("AxisDriver.servo/enabled")
def test_enabling_an_axis_in_motion_changes_nothing(harness: Harness) -> None:
    targets = harness.image.position_command + harness.travel()
    with harness.recording() as recording:
        harness.move(harness.all, targets)
        harness.pass_time(0.15)
        for axis in harness.all:
            harness.drivers.axes.servo(axis, True, 5.0)
        harness.rest()
    assert not harness.off_target(targets)
    fastest = np.array([harness.profile(axis).velocity for axis in harness.all])
    seen = np.abs(recording.velocity).max(0)
    assert (seen <= JUMP * fastest).all(), f"an axis has jumped: {seen} of at most {fastest}"


@pytest.mark.clause("drivers/rejects", "drivers/errors")
def test_a_disabled_axis_refuses_to_move(harness: Harness) -> None:
    harness.disable()
    harness.rest()
    start = harness.image.position.copy()
    with pytest.raises(NotReady):
        harness.move([0], start + harness.travel())
    with pytest.raises(OperationError):
        harness.drivers.axes.move(0, float(start[0] + harness.travel()[0]), Profile(0.5, 2.0, 2.0))
    harness.pass_time(0.3)
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.servo/no-jump", "AxisDriver.read/states")
def test_an_enabled_axis_holds_its_position(harness: Harness) -> None:
    """Checks each period; no state flickers."""
    start, states = harness.image.position.copy(), set[bytes]()

    def note(image: ProcessImage) -> None:
        states.add(image.flags.tobytes() + image.numbers.tobytes())

    harness.periods(3)
    with harness.recording() as recording, harness.each_period(note):
        harness.pass_time(1.0)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD
    assert len(states) == 1, "a state of an axis at rest has changed"
    assert harness.image.servo_on.all()


@pytest.mark.clause("AxisDriver.servo/switches")
def test_switching_a_servo_leaves_moving_axes_alone(harness: Harness) -> None:
    group = harness.servo_group(harness.count - 1)
    others = [axis for axis in harness.all if axis not in group]
    if not others:
        pytest.skip("all axes share one servo switch")
    targets = harness.image.position_command + harness.travel()
    with harness.recording() as recording:
        harness.move(others, targets)
        harness.pass_time(0.1)
        for on in (False, True):
            harness.drivers.axes.servo(group[0], on, 5.0)
        harness.rest(others)
    assert not harness.off_target(targets, others)
    assert harness.image.motion_complete[others].all()
    fastest = np.array([harness.profile(axis).velocity for axis in others])
    seen = np.abs(recording.velocity).max(0)[others]
    assert (seen <= JUMP * fastest).all(), f"an axis has jumped: {seen} of at most {fastest}"


@pytest.mark.clause("drivers/errors", "AxisDriver.servo/waits", "AxisDriver.clear_alarm/waits")
def test_what_takes_too_long_is_a_time_out(fresh: Harness) -> None:
    """Servo and alarm are done when the call returns, or it raises DeviceTimeout."""
    driver, last = fresh.drivers.axes, fresh.count - 1
    for on in (False, True):
        for timeout_s in (TOO_SHORT_S, 5.0):
            with suppress(DeviceTimeout) if timeout_s == TOO_SHORT_S else nullcontext():
                driver.servo(last, on, timeout_s)
                fresh.periods(1 if fresh.stepped else 3)
                assert fresh.image.servo_on[last] == on, "the call returns before it is done"
    if fresh.fault_injector is not None:
        with suppress(RobotdError):  # a drive that cannot be tripped
            fresh.fault_injector.trip(last, ALARM)
    fresh.periods(5)
    with suppress(DeviceTimeout):
        driver.clear_alarm(last, TOO_SHORT_S)
    driver.clear_alarm(last, 5.0)
    fresh.periods(2)
    assert not fresh.image.amp_alarm[last]
