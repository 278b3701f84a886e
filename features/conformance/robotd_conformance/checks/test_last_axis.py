"""The last axis: its alarms, switches and commands are not those of others."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import Capability, FaultInjector, Operation, RobotdError
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

ALARM = 0x2310


@pytest.fixture
def last(harness: Harness) -> int:
    if harness.count < 2:
        pytest.skip(f"the robot {harness.robot.descriptor.name} has one axis")
    return harness.count - 1


@pytest.mark.clause("AxisDriver.clear_alarm/waits")
@pytest.mark.clause("AxisDriver.read/alarms", "AxisDriver.clear_alarm/clears")
@pytest.mark.clause("AxisDriver.clear_alarm/idle")
def test_an_alarm_of_the_last_axis(harness: Harness, injector: FaultInjector, last: int) -> None:
    injector.trip(last, ALARM)
    harness.until(lambda: bool(harness.image.amp_alarm[last]), "the alarm is shown", 1.0)
    harness.periods(5)
    group = harness.alarm_group(last)
    assert list(np.flatnonzero(harness.image.amp_alarm)) == sorted(group)
    assert (harness.image.alarm_code[group] == ALARM).all()
    assert not np.delete(harness.image.alarm_code, group).any()
    assert not any(harness.image.reason[:last]), "the reason is shown on another axis"
    with pytest.raises(RobotdError):
        harness.move([last], harness.image.position_command + harness.travel())
    harness.drivers.axes.clear_alarm(last, 5.0)
    harness.periods(2)
    assert not harness.image.amp_alarm.any(), "clear_alarm returned before the alarm was gone"
    assert not harness.image.alarm_code.any()


@pytest.mark.clause("AxisDriver.clear_alarm/clears", "AxisDriver.clear_alarm/idle")
def test_clearing_an_alarm_leaves_moving_axes_alone(
    harness: Harness, injector: FaultInjector, last: int
) -> None:
    if harness.can(Capability.CONTROLLER_ALARM):
        pytest.skip("one alarm for all axes ends every motion")
    others = harness.all[:-1]
    targets = harness.image.position_command + harness.travel()
    harness.move(others, targets)
    harness.pass_time(0.1)
    injector.trip(last, ALARM)
    harness.until(lambda: bool(harness.image.amp_alarm[last]), "the alarm is shown", 1.0)
    harness.drivers.axes.clear_alarm(last, 5.0)
    harness.rest(others)
    assert not harness.off_target(targets, others)
    assert harness.image.motion_complete[others].all()


@pytest.mark.clause("AxisDriver.clear_alarm/idle")
def test_clearing_without_an_alarm_disturbs_no_motion(harness: Harness) -> None:
    targets = harness.move_all()
    harness.pass_time(0.12)
    for axis in harness.all:
        harness.drivers.axes.clear_alarm(axis, 5.0)
    harness.rest()
    assert not harness.off_target(targets)
    assert harness.image.motion_complete.all(), "clear_alarm stopped a running move"
    assert harness.image.servo_on.all()


@pytest.mark.clause("AxisDriver.read/switches")
@pytest.mark.parametrize("switch", ["negative_limit", "positive_limit", "home_switch"])
def test_a_switch_of_the_last_axis(disabled: Harness, switch: str) -> None:
    last = disabled.count - 1
    for pressed in (True, False, True, False):
        disabled.injector.press_switch(last, switch, pressed)
        disabled.periods(10)
        for name in ("negative_limit", "positive_limit", "home_switch"):
            expected = [axis == last and pressed and name == switch for axis in disabled.all]
            assert getattr(disabled.image, name).tolist() == expected, name


@pytest.mark.clause("AxisDriver.read/measured")
def test_a_jump_of_the_last_encoder(disabled: Harness) -> None:
    before, last = disabled.image.position.copy(), disabled.count - 1
    for delta in (0.02, -0.03):
        disabled.injector.jump_encoder(last, delta)
        disabled.periods(5)
        before[last] += delta
        assert disabled.image.position == pytest.approx(before, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.read/states")
def test_a_lost_last_drive_is_offline_alone(fresh: Harness) -> None:
    last = fresh.count - 1
    fresh.injector.disconnect(last)
    fresh.until(lambda: bool(fresh.image.offline[last]), "the lost drive is offline", 2.0)
    assert not fresh.image.offline[:last].any()
    assert not fresh.image.servo_on[last], "a lost drive is shown as enabled"


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.servo/disables")
def test_a_servo_goes_off_in_every_state(fresh: Harness) -> None:
    driver = fresh.drivers.axes
    for axis in (0, fresh.count - 1):
        for state in ("alarm", "motion", "stopping"):
            fresh.enable()
            fresh.periods(2)
            if state == "alarm":
                if fresh.fault_injector is None:
                    continue
                fresh.injector.trip(axis, ALARM)
                fresh.until(lambda axis=axis: bool(fresh.image.amp_alarm[axis]), "alarm", 1.0)  # type: ignore[misc]
            else:
                fresh.move([axis], fresh.image.position_command + fresh.travel(0.5))
                fresh.pass_time(0.1)
            if state == "stopping":
                driver.stop([axis])
            driver.servo(axis, False, 5.0)
            fresh.periods(3)
            assert not fresh.image.servo_on[axis], f"the servo stays on in {state}"
            fresh.rest()
            assert fresh.image.operation[axis] == Operation.IDLE
    fresh.enable()
    fresh.return_to_start()
