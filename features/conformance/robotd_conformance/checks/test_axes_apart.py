"""Commands and faults of one axis while the others move, in every kind of motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
import pytest

from robotd.api import (
    Capability,
    CommandMode,
    FaultInjector,
    Operation,
    RobotdError,
)
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.mixed_motion import STREAMED, Kind, MixedMotion, kinds_of, modes_of

ALARM = 0x2310
SPEEDS_UP_S, REACTS_S = 0.15, 0.1
MOVES_S = 0.8  # with the commands of one axis meanwhile

Event = Callable[[Harness, int], None]


def stop(harness: Harness, axis: int) -> None:
    harness.drivers.axes.stop([axis])


def quick_stop(harness: Harness, axis: int) -> None:
    harness.drivers.axes.quick_stop([axis])


def servo_off(harness: Harness, axis: int) -> None:
    harness.drivers.axes.servo(axis, False, 5.0)


def alarm(harness: Harness, axis: int) -> None:
    harness.injector.trip(axis, ALARM)


def servo_off_and_on(harness: Harness, axis: int) -> None:
    for on in (False, True):
        harness.drivers.axes.servo(axis, on, 5.0)


def alarm_and_clear(harness: Harness, axis: int) -> None:
    alarm(harness, axis)
    harness.until(lambda: bool(harness.image.amp_alarm[axis]), "the alarm is shown", 1.0)
    harness.drivers.axes.clear_alarm(axis, 5.0)


def change_mode(harness: Harness, axis: int) -> None:
    for mode in reversed(modes_of(harness)):
        harness.drivers.axes.set_command_mode(axis, mode)


def stream(harness: Harness, axis: int) -> None:
    if harness.robot.axes.trajectories_on_device:
        harness.drivers.axes.set_command_mode(axis, CommandMode.VELOCITY)
    harness.drivers.axes.begin_stream([axis])
    harness.drivers.axes.end_stream([axis])


def move(harness: Harness, axis: int) -> None:
    command = float(harness.image.position_command[axis])
    harness.drivers.axes.move(axis, command, harness.profile(axis))


def others_of(harness: Harness, axis: int, event: Event) -> list[int]:
    """Return the axes that ``event`` of ``axis`` does not concern; skip the check without any."""
    concerned = {axis}
    if event in (servo_off, servo_off_and_on):
        concerned |= set(harness.servo_group(axis))
    if event in (alarm, alarm_and_clear):
        concerned |= set(harness.alarm_group(axis))
    others = [axis for axis in harness.all if axis not in concerned]
    if not others:
        pytest.skip("all axes of the robot are concerned")
    return others


def turns(harness: Harness, number: int = 0) -> Sequence[int]:
    """Return the turns of a check; in real time one, another for each ``number``."""
    count = len(kinds_of(harness))
    return range(count) if harness.stepped else [number % count]


def by_name(function: Event) -> str:
    return function.__name__


ENDS = (stop, quick_stop, servo_off, alarm)
COMMANDS = (servo_off_and_on, alarm_and_clear, change_mode, stream, move)


@pytest.mark.clause(
    "AxisDriver.read/alarms", "AxisDriver.servo/disables", "AxisDriver.servo/switches"
)
@pytest.mark.clause("AxisDriver/others", "AxisDriver.stop/all-axes", "AxisDriver.quick_stop/starts")
@pytest.mark.parametrize("event", ENDS, ids=by_name)
def test_one_axis_ends_its_motion_alone(fresh: Harness, event: Event) -> None:
    for turn in turns(fresh, ENDS.index(event)):
        axis = 0 if turn % 2 else fresh.count - 1
        others, motion = others_of(fresh, axis, event), MixedMotion(fresh, turn, seconds=MOVES_S)
        if motion.kinds[axis] is Kind.TRAJECTORY:  # its axes stop together
            others = [axis for axis in others if motion.kinds[axis] is not Kind.TRAJECTORY]
        motion.prepare()
        with motion.running():
            fresh.pass_time(SPEEDS_UP_S)
            event(fresh, axis)
            fresh.pass_time(REACTS_S)
            what = f"the {motion.kinds[axis]} of axis {axis} has ended by {by_name(event)}"
            problems = motion.problems(others, what)
            shown = Operation(int(fresh.image.operation[axis]))
            if shown not in (Operation.IDLE, Operation.STOPPING):
                problems.append(f"axis {axis} is in {shown.name} when {what}")
            motion.sends = False
            fresh.drivers.axes.stop(fresh.all)
        fresh.rest()
        assert not problems, "; ".join(problems)


@pytest.mark.clause("AxisDriver/others", "AxisDriver.servo/switches")
@pytest.mark.clause("AxisDriver.clear_alarm/clears", "AxisDriver.begin_stream/follows")
@pytest.mark.clause("AxisDriver.move/starts")
@pytest.mark.parametrize("event", COMMANDS, ids=by_name)
def test_commands_of_an_idle_axis_leave_the_others_alone(fresh: Harness, event: Event) -> None:
    if event is change_mode and len(modes_of(fresh)) < 2:
        pytest.skip("there is one command mode")
    for turn in turns(fresh, COMMANDS.index(event)):
        axis = 0 if turn % 2 else fresh.count - 1
        others = others_of(fresh, axis, event)
        motion = MixedMotion(fresh, turn, idle=[axis], seconds=MOVES_S)
        motion.prepare()
        with motion.running():
            fresh.pass_time(SPEEDS_UP_S)
            event(fresh, axis)
            fresh.periods(2)
            problems = motion.problems(others, f"axis {axis} got {by_name(event)}")
            assert not problems, "; ".join(problems)
            motion.finish()
        fresh.rest()


@pytest.mark.clause("AxisDriver.servo/enabled", "AxisDriver.clear_alarm/idle")
@pytest.mark.clause("AxisDriver.begin_stream/again")
@pytest.mark.clause("AxisDriver.end_stream/idle")
def test_enabling_changes_no_kind_of_motion(fresh: Harness) -> None:
    """Nor does what has nothing to do: to clear no alarm, to begin a stream again, to end none."""
    driver = fresh.drivers.axes
    for turn in turns(fresh):
        motion = MixedMotion(fresh, turn, seconds=MOVES_S)
        motion.prepare()
        problems: list[str] = []
        with motion.running():
            fresh.pass_time(SPEEDS_UP_S)
            for axis in fresh.all:
                driver.servo(axis, True, 5.0)
                driver.clear_alarm(axis, 5.0)
            fresh.periods(2)
            problems += motion.problems(fresh.all, "it is enabled once more, and no alarm cleared")
            if streamed := motion.axes(*STREAMED):
                with suppress(RobotdError):  # it may be rejected
                    driver.begin_stream(streamed)
            fresh.periods(2)
            problems += motion.problems(fresh.all, "its stream is begun once more")
            if others := motion.axes(Kind.MOVE, Kind.JOG):
                driver.end_stream(others)
            fresh.periods(2)
            problems += motion.problems(fresh.all, "a stream of the others is ended")
            assert not problems, "; ".join(problems)
            motion.finish()
        fresh.rest()


@pytest.mark.clause("AxisDriver.servo/switches", "AxisDriver.servo_groups/groups")
def test_each_servo_is_switched_on_alone(harness: Harness) -> None:
    driver = harness.drivers.axes
    for axis in (*harness.all, *reversed(harness.all)):
        harness.disable()
        driver.servo(axis, True, 5.0)
        harness.periods(3)
        on = np.flatnonzero(harness.image.servo_on).tolist()
        group = sorted(harness.servo_group(axis))
        assert on == group, f"servo({axis}, True) has switched on axes {on}, not {group}"
    harness.enable()


@pytest.mark.clause("AxisDriver.clear_alarm/clears", "AxisDriver.read/alarms")
def test_alarms_of_all_axes_are_cleared_one_by_one(
    harness: Harness, injector: FaultInjector
) -> None:
    if harness.can(Capability.CONTROLLER_ALARM):
        pytest.skip(f"the {harness.robot.backend.name} backend has one alarm for all axes")
    image, codes = harness.image, ALARM + np.arange(harness.count)
    for order in (harness.all, harness.all[::-1]):
        for axis in harness.all:
            injector.trip(axis, int(codes[axis]))
        harness.until(lambda: bool((image.alarm_code == codes).all()), "each code is shown", 1.0)
        left, on = codes.copy(), image.servo_on.copy()
        for axis in order:
            harness.drivers.axes.clear_alarm(axis, 5.0)
            left[axis] = 0
            harness.periods(5)
            assert image.alarm_code.tolist() == left.tolist(), f"axis {axis} was cleared"
            assert image.amp_alarm.tolist() == (left > 0).tolist(), f"axis {axis} was cleared"
            assert not (image.servo_on & ~on).any(), f"clearing axis {axis} has switched servos on"
    harness.enable()


@pytest.mark.clause("AxisDriver.begin_stream/all", "drivers/rejects")
@pytest.mark.clause("AxisDriver.begin_stream/again")
def test_a_stream_of_an_axis_that_is_off_begins_for_none(streamed: Harness) -> None:
    if streamed.count < 2 or len(streamed.servo_group(0)) > 1:
        pytest.skip("no axis is off alone")
    driver = streamed.drivers.axes
    for off in (streamed.count - 1, 0):
        driver.servo(off, False, 5.0)
        streamed.periods(2)
        others = [axis for axis in streamed.all if axis != off]
        for streaming in ([], others):
            if streaming:
                driver.begin_stream(streaming)
            with pytest.raises(RobotdError):
                driver.begin_stream(streamed.all)
            streamed.periods(3)
            for axis in streamed.all:
                shown = Operation(int(streamed.image.operation[axis]))
                expected = Operation.STREAM if axis in streaming else Operation.IDLE
                assert shown is expected, (
                    f"axis {axis} is in {shown.name} after a rejected begin, axis {off} is off"
                )
        driver.end_stream(others)
        streamed.rest()
        streamed.enable()
    streamed.move_all(0.2)
    streamed.rest()
