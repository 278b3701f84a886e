"""Faults: shown, acted upon, cleared when asked to, and never healed by themselves."""

from __future__ import annotations

import re

import numpy as np
import pytest

from robotd.api import Capability, FaultInjector, NotReady, Operation
from robotd.api.robots import JointTolerance, Outcome
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

ALARM = 0x32
A_WORD = re.compile(r"[^\W\d_]{3}")
STUCK_RAD = 0.05  # path tolerance of a blocked joint
FREED_RAD = 0.01  # that a joint may move when it is freed


@pytest.mark.clause("AxisDriver.read/alarms")
def test_an_alarm_is_shown_with_its_code(harness: Harness) -> None:
    harness.trip(ALARM)
    group = harness.alarm_group(0)
    assert (harness.image.alarm_code[group] == ALARM).all()
    assert not np.delete(harness.image.amp_alarm, group).any()
    assert not np.delete(harness.image.alarm_code, group).any()


@pytest.mark.clause("AxisDriver.read/reason")
@pytest.mark.clause("AxisDriver.read/alarms")
def test_the_reason_of_an_alarm_comes_and_goes_with_it(harness: Harness) -> None:
    assert not any(harness.image.reason), "a reason without an alarm"
    harness.trip(ALARM)
    harness.periods(5)
    assert "\n" not in harness.image.reason[0], "a reason is part of a line"
    assert not any(harness.image.reason[1:]), "the reason is shown on another axis too"
    harness.robot.axes.clear_alarm(0)
    harness.until(lambda: not harness.image.reason[0], "the reason goes with the alarm", 1.0)


@pytest.mark.clause("AxisDriver.read/controller")
@pytest.mark.clause("AxisDriver.read/alarms")
@pytest.mark.needs(Capability.CONTROLLER_ALARM)
def test_an_alarm_of_the_controller_is_one_alarm(harness: Harness, injector: FaultInjector) -> None:
    image = harness.image
    injector.trip(0, ALARM)
    harness.until(lambda: bool(image.controller_alarm), "the controller's alarm is shown", 1.0)
    harness.periods(5)
    assert image.controller_alarm == ALARM
    assert image.amp_alarm.all(), "an axis without the controller's alarm"
    assert not any(image.reason), "the controller's alarm is shown by axes, too"
    text = image.controller_reason
    assert text == text.strip()
    assert A_WORD.search(text), "the alarm has no text"
    named = [
        problem for problem in harness.robot.problems if f"controller alarm {ALARM}" in problem
    ]
    assert len(named) == 1, f"{len(named)} problems name the alarm, instead of one"
    harness.robot.axes.clear_alarm(0)
    harness.until(lambda: not image.controller_alarm, "the alarm is cleared", 1.0)
    assert not image.controller_reason
    assert not image.amp_alarm.any()


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.read/alarms")
@pytest.mark.clause("AxisDriver.read/complete")
def test_an_alarm_ends_the_motion_of_its_axis_alone(
    harness: Harness, injector: FaultInjector
) -> None:
    targets = harness.move_all()
    harness.pass_time(0.2)
    injector.trip(0, ALARM)
    harness.rest()
    assert harness.image.operation[0] == Operation.IDLE
    assert abs(harness.image.position[0] - targets[0]) > SETTLED_RAD, "the move went on to its end"
    assert not harness.image.motion_complete[0], "the move that the alarm has ended is complete"
    others = [axis for axis in harness.all if axis not in harness.alarm_group(0)]
    assert not harness.off_target(targets, others)


@pytest.mark.clause("drivers/rejects")
def test_an_axis_in_alarm_refuses_to_move(harness: Harness) -> None:
    harness.trip(ALARM)
    start = harness.image.position.copy()
    with pytest.raises(NotReady):
        harness.move([0], start + harness.travel())
    harness.pass_time(0.2)
    assert abs(harness.image.position[0] - start[0]) <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.read/alarms")
def test_an_alarm_ends_a_trajectory_with_its_reason(
    harness: Harness, joints: list[int], injector: FaultInjector
) -> None:
    with harness.following([1.5], [harness.travel()[joints]]) as execution:
        harness.pass_time(0.4)
        injector.trip(joints[0], ALARM)
        harness.until(lambda: execution.done, "the trajectory ends")
    assert execution.outcome is Outcome.FAULT
    named = "controller alarm" if harness.can(Capability.CONTROLLER_ALARM) else "amplifier alarm"
    assert f"{named} {ALARM}" in execution.message
    if not harness.can(Capability.CONTROLLER_ALARM):
        assert harness.robot.joint_names[0] in execution.message


@pytest.mark.clause("AxisDriver.read/alarms", "AxisDriver.clear_alarm/clears")
@pytest.mark.clause("AxisDriver/servos")
def test_an_alarm_stays_until_it_is_cleared_and_then_nothing_moves(
    harness: Harness, injector: FaultInjector
) -> None:
    harness.move([0], harness.image.position_command + harness.travel())
    harness.pass_time(0.15)
    injector.trip(0, ALARM)
    harness.rest()
    harness.pass_time(0.5)
    assert harness.image.amp_alarm[0], "the alarm went away by itself"
    off = not harness.image.servo_on[0]
    start = harness.image.position[0]
    harness.robot.axes.clear_alarm(0)
    harness.pass_time(0.3)
    assert not harness.image.amp_alarm[0]
    assert harness.image.alarm_code[0] == 0
    assert not (off and harness.image.servo_on[0]), "clearing an alarm enabled the servo"
    assert abs(harness.image.position[0] - start) <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.stream/setpoint")
@pytest.mark.short_period
def test_a_joint_that_was_blocked_does_not_leap_when_it_is_freed(
    harness: Harness, joints: list[int], injector: FaultInjector
) -> None:
    """After a tolerance failure the command returns to the measured position."""
    axis, name = joints[0], harness.robot.joint_names[0]
    travel, path = harness.travel()[joints], [JointTolerance(name, STUCK_RAD)]
    injector.block(axis, True)
    with harness.following([1.2], [travel], path=path) as execution:
        harness.until(lambda: execution.done, "the goal of the blocked joint ends")
    assert execution.outcome in (Outcome.PATH_TOLERANCE, Outcome.FAULT), execution.message
    assert name in execution.message
    with harness.recording() as recording:
        harness.pass_time(0.1)
        injector.block(axis, False)
        harness.pass_time(0.4)
    assert np.ptp(recording.position[:, axis]) <= FREED_RAD


@pytest.mark.clause("AxisDriver.clear_alarm/clears")
def test_it_works_again_after_an_alarm(harness: Harness, injector: FaultInjector) -> None:
    injector.trip(0, ALARM)
    harness.rest()
    harness.enable()
    targets = harness.move_all(0.3)
    harness.rest()
    assert not harness.off_target(targets)


@pytest.mark.clause("AxisDriver.clear_alarm/idle")
def test_clearing_without_an_alarm_has_no_effect(harness: Harness) -> None:
    start = harness.image.position.copy()
    for axis in harness.all:
        harness.robot.axes.clear_alarm(axis)
    harness.pass_time(0.2)
    assert harness.image.servo_on.all()
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.read/states")
def test_a_drive_that_is_lost_is_offline(fresh: Harness) -> None:
    fresh.injector.disconnect(0)
    fresh.until(lambda: bool(fresh.image.offline[0]), "the lost drive is offline", 2.0)
    assert not fresh.image.offline[1:].any()
    assert not any(fresh.image.reason[1:])
    with pytest.raises(NotReady):
        fresh.move([0], fresh.image.position_command + fresh.travel())


@pytest.mark.clause("FieldbusDriver.start_hot_connect/joins")
@pytest.mark.needs(Capability.HOT_CONNECT)
@pytest.mark.parametrize("axis", [0, -1], ids=["first", "last"])
@pytest.mark.clause("AxisDriver/servos")
def test_a_drive_that_is_back_stays_off(fresh: Harness, axis: int) -> None:
    injector, axis = fresh.injector, axis % fresh.count
    injector.disconnect(axis)
    fresh.until(lambda: bool(fresh.image.offline[axis]), "the lost drive is offline", 2.0)
    injector.reconnect(axis)
    fresh.robot.fieldbus.start_hot_connect(0)
    fresh.until(lambda: not fresh.image.offline[axis], "the drive is back")
    fresh.pass_time(0.3)
    assert not fresh.image.servo_on[axis], "the servo was enabled by itself"
    fresh.enable()
