"""Faults: shown, acted upon, cleared when asked to, and never healed by themselves."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.cycle.execution import Outcome
from robotd.device.bench import Bench
from robotd.device.capabilities import Capability
from robotd.device.state import Operation
from robotd.errors import NotReady
from robotd.testing.conformance.rig import SETTLED_RAD, MakeRig, Rig
from robotd.testing.conformance.stand import BenchOrSkip

ALARM = 0x32


def test_an_alarm_is_shown_with_its_code(rig: Rig, bench: Bench) -> None:
    bench.trip(0, ALARM)
    rig.until(lambda: bool(rig.image.amp_alarm[0]), "the alarm is shown", 1.0)
    assert rig.image.alarm_code[0] == ALARM
    assert not rig.image.amp_alarm[1:].any()
    assert not rig.image.alarm_code[1:].any()


def test_the_reason_of_an_alarm_comes_and_goes_with_it(rig: Rig, bench: Bench) -> None:
    assert not any(rig.image.reason), "a reason without an alarm"
    bench.trip(0, ALARM)
    rig.until(lambda: bool(rig.image.amp_alarm[0]), "the alarm is shown", 1.0)
    rig.periods(5)
    assert "\n" not in rig.image.reason[0], "a reason is part of a line"
    assert not any(rig.image.reason[1:]), "the reason is shown on another axis too"
    rig.robot.axes.clear_alarm(0)
    rig.until(lambda: not rig.image.reason[0], "the reason goes with the alarm", 1.0)


def test_an_alarm_ends_the_motion_of_its_axis_alone(rig: Rig, bench: Bench) -> None:
    targets = rig.image.position_command + rig.travel()
    rig.move(rig.all, targets)
    rig.let(0.2)
    bench.trip(0, ALARM)
    rig.rest()
    assert rig.image.operation[0] == Operation.IDLE
    assert abs(rig.image.position[0] - targets[0]) > SETTLED_RAD
    assert not rig.image.motion_complete[0]
    assert np.abs(rig.image.position[1:] - targets[1:]).max(initial=0.0) <= SETTLED_RAD


def test_an_axis_in_alarm_refuses_to_move(rig: Rig, bench: Bench) -> None:
    bench.trip(0, ALARM)
    rig.until(lambda: bool(rig.image.amp_alarm[0]), "the alarm is shown", 1.0)
    start = rig.image.position.copy()
    with pytest.raises(NotReady):
        rig.move([0], start + rig.travel())
    rig.let(0.2)
    assert abs(rig.image.position[0] - start[0]) <= SETTLED_RAD


def test_an_alarm_ends_a_trajectory_with_its_reason(jointed: Rig) -> None:
    rig, bench = jointed, BenchOrSkip.of(jointed)
    way = rig.travel()[list(rig.robot.joint_axes)]
    with rig.following([1.5], [way]) as execution:
        rig.let(0.4)
        bench.trip(rig.robot.joint_axes[0], ALARM)
        rig.until(lambda: execution.done, "the trajectory ends")
    assert execution.outcome is Outcome.FAULT
    assert rig.robot.joint_names[0] in execution.message


def test_an_alarm_stays_until_it_is_cleared_and_then_nothing_moves(rig: Rig, bench: Bench) -> None:
    rig.move([0], rig.image.position_command + rig.travel())
    rig.let(0.15)
    bench.trip(0, ALARM)
    rig.rest()
    rig.let(0.5)
    assert rig.image.amp_alarm[0], "the alarm went away by itself"
    off = not rig.image.servo_on[0]
    start = rig.image.position[0]
    rig.robot.axes.clear_alarm(0)
    rig.let(0.3)
    assert not rig.image.amp_alarm[0]
    assert rig.image.alarm_code[0] == 0
    assert not (off and rig.image.servo_on[0]), "clearing an alarm enabled the servo"
    assert abs(rig.image.position[0] - start) <= SETTLED_RAD


def test_it_works_again_after_an_alarm(rig: Rig, bench: Bench) -> None:
    bench.trip(0, ALARM)
    rig.rest()
    rig.enable()
    targets = rig.image.position_command + rig.travel(0.3)
    rig.move(rig.all, targets)
    rig.rest()
    assert rig.image.position == pytest.approx(targets, abs=SETTLED_RAD)


def test_clearing_without_an_alarm_has_no_effect(rig: Rig) -> None:
    start = rig.image.position.copy()
    for axis in rig.all:
        rig.robot.axes.clear_alarm(axis)
    rig.let(0.2)
    assert rig.image.servo_on.all()
    assert np.abs(rig.image.position - start).max() <= SETTLED_RAD


def test_a_drive_that_is_lost_is_offline(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    BenchOrSkip.of(rig).disconnect(0)
    rig.until(lambda: bool(rig.image.offline[0]), "the lost drive is offline", 2.0)
    assert not rig.image.offline[1:].any()
    assert not any(rig.image.reason[1:])
    with pytest.raises(NotReady):
        rig.move([0], rig.image.position_command + rig.travel())


@pytest.mark.needs(Capability.HOT_CONNECT)
def test_a_drive_that_is_back_stays_off(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    bench = BenchOrSkip.of(rig)
    bench.disconnect(0)
    rig.until(lambda: bool(rig.image.offline[0]), "the lost drive is offline", 2.0)
    bench.reconnect(0)
    rig.robot.fieldbus.start_hot_connect(0)
    rig.until(lambda: not rig.image.offline[0], "the drive is back")
    rig.let(0.3)
    assert not rig.image.servo_on[0], "the servo was enabled by itself"
    rig.enable()
