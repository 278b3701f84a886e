"""Servo on and off by the CiA 402 layer on a simulated drive, without a bus."""

from __future__ import annotations

import threading

import pytest
from structlog.testing import capture_logs
from tests.plugins.cia402.looped_drive import (
    FAST,
    LoopedDrive,
    idle,
    peak_velocity,
)

from robotd.api import (
    DeviceTimeout,
    MonotonicClock,
    Operation,
    OperationError,
    Profile,
    RobotdError,
    wait_until,
)
from robotd_cia402.controlword import DriveState
from robotd_cia402.device import switch_off
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import (
    INPUTS,
    MODE_DISPLAY,
)


def test_servo_on_and_off(on: LoopedDrive) -> None:
    assert on.axis.report.state is DriveState.OPERATION_ENABLED
    assert on.axis.report.displayed_mode == OperationMode.CYCLIC_POSITION
    on.commands.disable(1.0)
    on.run(0.02)
    assert not on.axis.report.powered
    assert not on.image.servo_on[0]


def test_servo_on_in_motion_changes_nothing(on: LoopedDrive) -> None:
    on.commands.move(1.0, Profile(velocity=0.5, acceleration=5.0, deceleration=5.0))
    on.run(0.9)
    on.commands.enable(1.0)
    assert on.image.operation[0] == Operation.POSITION
    assert peak_velocity(on, 500) == pytest.approx(0.5, abs=0.05)
    assert on.drive.position == pytest.approx(1.0, abs=1e-3)


def test_servo_on_leaves_a_quick_stop_of_a_stream_without_a_step(on: LoopedDrive) -> None:
    on.commands.prepare_stream()
    on.commands.begin_stream()
    for step in range(100):
        on.axis.follow(0.004 * step, 1.0)
        on.run(0.004)
    on.commands.quick_stop()
    idle(on)
    rest = on.drive.position
    on.commands.enable(1.0)
    assert on.axis.report.state is DriveState.OPERATION_ENABLED
    assert peak_velocity(on) < 0.01
    assert on.drive.position == pytest.approx(rest, abs=1e-4)


def test_a_servo_that_is_switched_off_while_a_quick_stop_begins_goes_off(on: LoopedDrive) -> None:
    """The quick stop has read that the servo is meant to be on."""
    power = on.axis.power
    release = threading.Thread(target=power.release, args=[on.axis.report.state])

    class Requested:
        def __bool__(self) -> bool:
            release.start()
            release.join(0.1)  # it waits for the end of the quick stop
            return True

    on.commands.move(2.0, FAST)
    on.run(0.2)
    power.requested = Requested()  # type: ignore[assignment]
    on.commands.quick_stop()
    release.join(5.0)
    on.run(0.5)
    assert not on.axis.report.powered


def test_a_quick_stop_that_ends_with_the_servo_off_is_not_left(on: LoopedDrive) -> None:
    on.commands.move(2.0, FAST)
    on.run(0.2)
    on.commands.quick_stop()
    idle(on)
    on.axis.power.release(on.axis.report.state)  # asked for; the drive has not followed yet
    with pytest.raises(RobotdError):
        on.commands.move(2.0, FAST)
    assert not on.axis.report.powered


@pytest.mark.parametrize("resting", [True, False])
def test_the_servo_goes_off_from_a_quick_stop(on: LoopedDrive, resting: bool) -> None:
    on.commands.jog(FAST)
    on.run(0.5)
    on.commands.quick_stop()
    if resting:
        idle(on)
        assert on.axis.report.state is DriveState.QUICK_STOP_ACTIVE
    on.commands.disable(1.0)
    assert on.axis.report.state is DriveState.SWITCH_ON_DISABLED
    on.run(2.0)  # in motion the motor has run out
    on.commands.enable(1.0)
    assert peak_velocity(on, 50) < 0.01


def test_a_servo_that_does_not_take_its_mode_goes_off_again() -> None:
    looped = LoopedDrive()
    take = looped.objects.take

    def other_mode() -> None:
        take()
        looped.objects._taken[INPUTS.index(MODE_DISPLAY)] = OperationMode.PROFILE_VELOCITY

    looped.objects.take = other_mode  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout, match="mode cyclic_position was requested"):
        looped.commands.enable(1.0)
    looped.run(0.1)
    assert not looped.axis.report.powered


def test_a_second_servo_off_ends_a_quick_stop_as_well(on: LoopedDrive) -> None:
    on.commands.move(2.0, FAST)
    on.run(0.2)
    on.commands.quick_stop()
    on.run(0.004)  # it is sent, and not reported yet
    on.axis.power.release(on.axis.report.state)
    on.commands.disable(1.0)
    assert not on.axis.report.powered


def test_servo_off_does_not_wait_for_the_answers_to_another_command(on: LoopedDrive) -> None:
    write, powered = on.objects.write, list[bool]()
    off = threading.Thread(target=on.commands.disable, args=(2.0,))

    def slow(index: int, sub: int, value: int) -> None:
        if off.ident is None:
            off.start()
            wait_until(lambda: not on.axis.power.requested, 0.2, MonotonicClock())
            on.run(0.5)
            powered.append(on.axis.report.powered)
        write(index, sub, value)

    on.objects.write = slow  # type: ignore[method-assign]
    with pytest.raises(OperationError, match="stopped before the motion began"):
        on.commands.move(0.5, FAST)
    off.join(10.0)
    assert powered == [False]


def check_servo_on_is_ended(
    looped: LoopedDrive, off: threading.Thread, at: DriveState | None = None
) -> None:
    """Run ``off`` while the servo is being switched on, in state ``at`` or at once."""
    states, require_no_alarm = list[DriveState](), looped.commands._require_no_alarm

    def switch_off_meanwhile() -> None:
        states.append(looped.axis.report.state)
        if off.ident is None and at in (None, states[-1]):
            off.start()
            off.join(0.2)
        require_no_alarm()

    looped.commands._require_no_alarm = switch_off_meanwhile  # type: ignore[method-assign]
    with pytest.raises(OperationError, match="switched off before the servo was on"):
        looped.commands.enable(1.0)
    off.join(10.0)
    assert at in (None, states[-1])
    assert not looped.axis.report.powered


def test_servo_off_ends_a_servo_on() -> None:
    looped = LoopedDrive()
    off = threading.Thread(target=looped.commands.disable, args=(1.0,))
    check_servo_on_is_ended(looped, off, DriveState.SWITCHED_ON)


def test_a_servo_on_that_has_waited_for_another_command_too_long_switches_nothing_on() -> None:
    """Its caller has got the error that it has failed."""
    looped, failures = LoopedDrive(), list[Exception]()
    looped.run(0.1)

    def enable() -> None:
        try:
            looped.commands.enable(0.5)
        except RobotdError as error:
            failures.append(error)

    waiting = threading.Thread(target=enable)
    with looped.axis.lock:
        waiting.start()
        waiting.join(0.1)
        looped.run(1.0)
    waiting.join(10.0)
    looped.run(0.5)
    assert not looped.axis.report.powered
    assert len(failures) == 1


@pytest.mark.parametrize("command", ["move", "home"])
def test_servo_off_prevents_the_motion_of_a_command_that_is_being_started(command: str) -> None:
    looped = LoopedDrive(homing_method=19)
    looped.commands.enable(1.0)
    write, stops = looped.objects.write, looped.axis.activity.stops
    off = threading.Thread(target=looped.commands.disable, args=(2.0,))

    def switch_off_meanwhile(index: int, sub: int, value: int) -> None:
        if off.ident is None:
            off.start()
            wait_until(lambda: looped.axis.activity.stops > stops, 1.0, MonotonicClock())
        write(index, sub, value)

    looped.objects.write = switch_off_meanwhile  # type: ignore[method-assign]
    start = {
        "move": lambda: looped.commands.move(0.5, FAST),
        "home": lambda: looped.commands.home(5.0),
    }
    with pytest.raises(OperationError, match="stopped before the motion began"):
        start[command]()
    off.join(10.0)
    assert not looped.axis.report.powered
    assert looped.drive.position == pytest.approx(0.0, abs=1e-4)


def test_an_axis_in_motion_is_stopped_before_it_is_switched_off(on: LoopedDrive) -> None:
    on.commands.move(2.0, FAST)
    on.run(0.5)
    switch_off([on.axis], 2.0, on.clock)
    on.run(0.02)
    assert not on.image.servo_on[0]
    assert on.image.velocity[0] == pytest.approx(0.0, abs=0.01)
    assert on.drive.position < 1.0


def test_the_end_of_communication_ends_a_servo_on() -> None:
    looped = LoopedDrive()
    off = threading.Thread(target=switch_off, args=([looped.axis], 1.0, looped.clock))
    check_servo_on_is_ended(looped, off)


def test_a_servo_that_stays_on_is_logged(on: LoopedDrive) -> None:
    on.faults.statusword = 0x0637  # operation enabled, whatever happens
    with capture_logs() as lines:
        switch_off([on.axis], 1.0, on.clock)
    assert "the servo did not go off within 0.5 s" in lines[-1]["reason"]


def test_servo_on_waits_for_the_end_of_a_servo_off(on: LoopedDrive) -> None:
    on.faults.statusword = 0x0637  # operation enabled, whatever happens
    with pytest.raises(DeviceTimeout, match="did not go off"):
        on.commands.disable(0.1)
    with pytest.raises(DeviceTimeout, match="the last servo-off has not ended within"):
        on.commands.enable(0.1)
    on.faults.statusword = None
    on.commands.enable(1.0)
    on.run(0.1)
    assert on.image.servo_on[0]
