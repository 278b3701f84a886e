"""Commands of the CiA 402 layer on a simulated drive, without a bus: the protocol is enough."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from typing import Any

import pytest
from structlog.testing import capture_logs
from tests.plugins.cia402.looped_drive import SUPPORTED_MODES, LoopedDrive

from robotd.api import (
    NANOSECONDS,
    CommandMode,
    DeviceTimeout,
    InvalidArgument,
    MonotonicClock,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    Profile,
    RobotdError,
    wait_until,
)
from robotd_cia402.controlword import DriveState, Phase
from robotd_cia402.device import switch_off
from robotd_cia402.drive_setup import interpolation_period, set_up
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import (
    DEMAND,
    INPUTS,
    MODE,
    MODE_DISPLAY,
    OUTPUTS,
    POSITION,
    TARGET_VELOCITY,
)
from robotd_cia402.simulated.drive import State
from robotd_cia402.simulated.mode_motion import Mode

FAST = Profile(velocity=1.0, acceleration=5.0, deceleration=5.0)


@pytest.fixture
def on() -> LoopedDrive:
    """A drive with its servo on, at rest."""
    made = LoopedDrive()
    made.commands.enable(1.0)
    return made


def idle(looped: LoopedDrive, limit_s: float = 5.0) -> None:
    """Run until the axis has no operation."""
    periods = round(limit_s / 0.02)
    for _ in range(periods):
        looped.run(0.02)
        if looped.axis.activity.is_idle:
            return
    pytest.fail(f"still {looped.axis.activity.operation.name} after {limit_s} s")


def test_servo_on_and_off(on: LoopedDrive) -> None:
    assert on.axis.report.state is DriveState.OPERATION_ENABLED
    assert on.axis.report.displayed_mode == OperationMode.CYCLIC_POSITION
    on.commands.disable(1.0)
    on.run(0.02)
    assert not on.axis.report.powered
    assert not on.image.servo_on[0]


def test_a_move_reaches_its_target_and_shows_its_profile(on: LoopedDrive) -> None:
    on.commands.move(0.5, FAST)
    on.run(0.25)
    assert on.image.operation[0] == Operation.POSITION
    assert on.image.velocity_command[0] == pytest.approx(1.0)
    idle(on)
    assert on.axis.activity.complete
    assert on.drive.position == pytest.approx(0.5, abs=1e-3)
    assert on.image.position_command[0] == pytest.approx(0.5, abs=1e-5)


def test_a_move_begins_without_a_step_in_a_drive_that_changes_its_mode_late() -> None:
    looped = LoopedDrive()
    send, requested = looped.objects.send, [0] * 5

    def change_mode_late() -> None:
        send()
        requested.append(looped.objects.dictionary[MODE, 0])
        looped.objects.dictionary[MODE, 0] = requested.pop(0)

    looped.objects.send = change_mode_late  # type: ignore[method-assign]
    looped.commands.enable(1.0)
    looped.commands.move(2.0, FAST)
    assert peak_velocity(looped, 700) == pytest.approx(FAST.velocity, abs=0.05)
    assert looped.drive.position == pytest.approx(2.0, abs=1e-3)


def test_a_stop_brakes_a_move_before_its_target(on: LoopedDrive) -> None:
    on.commands.move(2.0, FAST)
    on.run(0.5)
    on.commands.stop()
    idle(on)
    assert 0.2 < on.drive.position < 1.0
    assert not on.axis.activity.complete


@pytest.mark.parametrize("phase", [Phase.ENTERING, Phase.ASKING, Phase.RELEASING])
def test_a_stop_in_the_middle_of_a_frame_of_the_handshake_counts(
    on: LoopedDrive, phase: Phase
) -> None:
    """The control loop has read the phase and not yet written the bits."""
    mode, stopping = on.axis.mode, threading.Thread(target=on.commands.stop)

    class Word(int):
        def __and__(self, bits: int) -> int:
            if mode.phase is phase and stopping.ident is None:
                stopping.start()
                stopping.join(0.1)  # it waits for the end of the frame
            return int(self) & bits

    advance = mode.advance_target

    def raced(word: int, *rest: Any) -> bool:
        ended = advance(Word(word), *rest)
        if stopping.ident is not None:
            stopping.join(5.0)
        return ended

    mode.advance_target = raced  # type: ignore[method-assign]
    on.commands.move(2.0, FAST)
    idle(on)
    on.run(0.5)
    assert on.drive.position < 0.1
    assert not on.axis.activity.complete


@pytest.mark.parametrize("velocity_mode", ["pv", "csv"])
def test_a_jog_moves_at_its_speed_until_it_is_stopped(velocity_mode: str) -> None:
    looped = LoopedDrive(velocity_mode=velocity_mode)
    looped.commands.enable(1.0)
    looped.commands.jog(FAST)
    looped.run(1.0)
    assert looped.image.velocity[0] == pytest.approx(1.0, abs=0.05)
    looped.commands.jog(Profile(velocity=0.0, acceleration=5.0, deceleration=5.0))
    idle(looped)
    assert looped.image.velocity_command[0] == 0.0


@pytest.mark.parametrize("stream_mode", ["csp", "ip"])
def test_streamed_setpoints_are_followed(stream_mode: str) -> None:
    looped = LoopedDrive(stream_mode=stream_mode)
    looped.commands.enable(1.0)
    looped.commands.prepare_stream()
    looped.commands.begin_stream()
    for step in range(100):
        looped.axis.follow(0.001 * step, 0.25)
        looped.run(0.004)
    looped.axis.follow(0.1, 0.0)
    looped.run(0.2)
    looped.commands.end_stream()
    assert looped.axis.activity.complete
    assert looped.drive.position == pytest.approx(0.1, abs=1e-3)


def test_a_quick_stop_keeps_the_power_and_the_next_move_leaves_it(on: LoopedDrive) -> None:
    on.commands.move(2.0, FAST)
    on.run(0.5)
    on.commands.quick_stop()
    on.run(0.1)
    assert on.axis.report.state is DriveState.QUICK_STOP_ACTIVE
    idle(on)
    on.commands.move(0.0, FAST)
    idle(on)
    assert on.drive.position == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("hard", [5.0, 80.0])
def test_a_quick_stop_takes_over_a_gentler_stop(on: LoopedDrive, hard: float) -> None:
    """The drive has 40 rad/s² for a quick stop: a harder ramp of the command stays in force."""
    on.commands.move(9.0, Profile(velocity=2.0, acceleration=20.0, deceleration=hard))
    on.run(0.3)
    on.commands.stop()
    on.run(0.008)
    speed, stopped = on.image.velocity_command[0], on.drive.position
    on.commands.quick_stop()
    idle(on)
    way = speed**2 / (2.0 * max(hard, 40.0))
    assert on.drive.position - stopped == pytest.approx(way, abs=0.02)
    assert on.image.position_command[0] == pytest.approx(on.drive.position, abs=1e-3)


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_velocity_command_that_turns_slows_down_by_its_deceleration(velocity_mode: str) -> None:
    looped = LoopedDrive(velocity_mode=velocity_mode)
    looped.commands.set_mode(CommandMode.VELOCITY)
    looped.commands.enable(1.0)
    looped.commands.jog(Profile(velocity=1.0, acceleration=10.0, deceleration=10.0))
    looped.run(0.5)
    looped.commands.jog(Profile(velocity=-1.0, acceleration=10.0, deceleration=2.0))
    looped.run(0.25)
    assert looped.image.velocity_command[0] == pytest.approx(0.5, abs=0.05)
    looped.run(0.3)
    assert looped.image.velocity_command[0] == pytest.approx(-0.5, abs=0.1)


def peak_velocity(looped: LoopedDrive, periods: int = 250) -> float:
    """Return the largest velocity of the motor while it runs; an axis at rest does not jump."""
    velocities = []
    for _ in range(periods):
        looped.run(0.004)
        velocities.append(abs(looped.motors.velocity(0)))
    return max(velocities)


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


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_lost_drive_gets_no_velocity(velocity_mode: str) -> None:
    """It may receive what is sent."""
    looped, sent = LoopedDrive(velocity_mode=velocity_mode), list[int]()
    put = looped.objects.put

    def note(values: Sequence[int]) -> None:
        put(values)
        sent.append(values[OUTPUTS.index(TARGET_VELOCITY)])

    looped.objects.put = note  # type: ignore[method-assign]
    looped.commands.enable(1.0)
    looped.commands.jog(FAST)
    looped.run(0.5)
    assert sent[-1]
    looped.objects.node.online = False
    looped.run(0.5)
    assert not sent[-1]
    with pytest.raises(NotReady, match="node 1: offline"):
        looped.commands.set_mode(CommandMode.POSITION)


@pytest.mark.parametrize("motion", ["stream", "jog", "move"])
def test_a_quick_stop_of_the_drive_itself_ends_the_motion(on: LoopedDrive, motion: str) -> None:
    """It is left when its cause has ended, for "enable operation" stays in the controlword."""
    if motion == "stream":
        on.commands.prepare_stream()
        on.commands.begin_stream()
    elif motion == "jog":
        on.commands.jog(FAST)
    else:
        on.commands.move(2.0, FAST)
    enter = on.drive._enter
    for step in range(200):
        if on.axis.activity.streaming:
            on.axis.follow(0.004 * step, 1.0)
        if step == 100:
            enter(State.QUICK_STOP_ACTIVE)
            on.drive._enter = lambda state: None  # type: ignore[method-assign]
        if step == 150:
            on.drive._enter = enter  # type: ignore[method-assign]
        on.run(0.004)
    assert on.drive.position < 0.5
    assert peak_velocity(on, 100) < 0.01
    assert on.axis.activity.is_idle


def test_a_move_waits_for_the_end_of_a_quick_stop(on: LoopedDrive) -> None:
    on.commands.move(3.0, Profile(velocity=2.0, acceleration=20.0, deceleration=20.0))
    on.run(0.5)
    on.commands.quick_stop()
    on.run(0.02)
    braking = on.image.position_command[0]
    on.commands.move(3.0, FAST)
    assert on.axis.report.state is DriveState.OPERATION_ENABLED
    assert on.drive.position > braking
    assert abs(on.motors.velocity(0)) < 0.05
    idle(on)
    assert on.drive.position == pytest.approx(3.0, abs=1e-3)


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


@pytest.mark.parametrize("by_supervision", [False, True])
@pytest.mark.parametrize("command", ["move", "jog", "home"])
def test_a_stop_during_the_sdo_of_a_command_prevents_its_motion(
    command: str, by_supervision: bool
) -> None:
    looped = LoopedDrive(homing_method=19)
    looped.commands.enable(1.0)
    write = looped.objects.write

    def stop_meanwhile(index: int, sub: int, value: int) -> None:
        if by_supervision:
            looped.axis.brake(10.0)
        else:
            looped.commands.stop()
        write(index, sub, value)

    looped.objects.write = stop_meanwhile  # type: ignore[method-assign]
    start = {
        "move": lambda: looped.commands.move(0.5, FAST),
        "jog": lambda: looped.commands.jog(FAST),
        "home": lambda: looped.commands.home(5.0),
    }
    with pytest.raises(OperationError, match="stopped before the motion began"):
        start[command]()
    assert peak_velocity(looped) < 0.01
    assert looped.image.operation[0] == Operation.IDLE


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


def test_servo_off_ends_a_homing() -> None:
    looped = LoopedDrive(homing_method=19, homing_speed_rad_s=0.5)
    looped.commands.enable(1.0)
    failures: list[Exception] = []

    def search() -> None:
        try:
            looped.commands.home(30.0)
        except RobotdError as error:
            failures.append(error)

    thread = threading.Thread(target=search)
    thread.start()
    looped.commands._wait(lambda: looped.axis.activity.operation is Operation.HOMING, 5.0)
    looped.commands.disable(2.0)
    thread.join(10.0)
    assert not looped.axis.report.powered
    assert len(failures) == 1
    assert looped.clock.now_ns() < 10e9


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
    """Its caller has been told that it has failed."""
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


def test_a_homing_that_fails_in_motion_ends_without_a_step() -> None:
    looped = LoopedDrive(homing_method=19, homing_speed_rad_s=0.5, homing_acceleration_rad_s2=1.0)
    looped.commands.enable(1.0)
    steps: list[float] = []
    before = 0.0
    observe = looped.axis.observe

    def note(image: ProcessImage) -> None:
        nonlocal before
        observe(image)
        velocity = looped.motors.velocity(0)
        steps.append(abs(velocity - before))
        before = velocity

    looped.axis.observe = note  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout, match="homing did not end"):
        looped.commands.home(1.0)
    looped.run(1.0)
    assert max(steps) < 2.0 * 1.0 * 0.004
    assert looped.motors.velocity(0) == pytest.approx(0.0, abs=1e-4)


def test_homing_at_the_present_position_sets_zero_without_motion(on: LoopedDrive) -> None:
    on.commands.move(0.3, FAST)
    idle(on)
    on.commands.home(5.0)
    on.run(0.02)
    assert on.image.position[0] == pytest.approx(0.0, abs=1e-3)
    assert on.image.position_command[0] == pytest.approx(0.0, abs=1e-3)
    assert on.image.home_done[0]


def test_homing_searches_the_switch() -> None:
    looped = LoopedDrive(homing_method=19, simulated_switches={"home_rad": 0.05})
    looped.commands.enable(1.0)
    looped.commands.home(10.0)
    looped.run(0.5)
    assert looped.image.home_done[0]
    assert looped.motors.position(0) == pytest.approx(0.04, abs=5e-3)


def test_the_statusword_of_the_homing_before_does_not_end_a_homing() -> None:
    looped = LoopedDrive(homing_method=19, simulated_switches={"home_rad": 0.3})
    looped.commands.enable(1.0)
    motion = looped.drive.motion
    change = motion._change

    def change_to_homed(mode: Mode) -> None:
        change(mode)
        motion.mode_bit = mode is Mode.HOMING

    motion._change = change_to_homed  # type: ignore[method-assign]
    looped.commands.home(20.0)
    assert motion.zero == pytest.approx(0.29, abs=1e-3)


def test_homing_without_a_switch_names_the_limit() -> None:
    looped = LoopedDrive(homing_method=19)
    looped.commands.enable(1.0)
    with pytest.raises(DeviceTimeout, match=r"node 1: homing did not end within 0.5 s"):
        looped.commands.home(0.5)


def test_an_unsupported_homing_method_fails() -> None:
    looped = LoopedDrive(homing_method=1)
    looped.commands.enable(1.0)
    with pytest.raises(OperationError, match="homing failed"):
        looped.commands.home(5.0)


def test_a_trip_switches_off_with_the_emergency_and_is_cleared(on: LoopedDrive) -> None:
    on.drive.trip(0x3210)
    on.run(0.5)
    assert on.image.amp_alarm[0]
    assert on.image.alarm_code[0] == 0x3210
    assert "EMCY 0x3210 DC link over-voltage" in on.image.reason[0]
    with pytest.raises(NotReady, match="the drive is in alarm: EMCY 0x3210"):
        on.commands.move(1.0, FAST)
    on.commands.clear_alarm(1.0)
    on.run(0.02)
    assert not on.image.amp_alarm[0]
    assert not on.axis.report.powered  # nothing switches on by itself
    on.commands.enable(1.0)


def test_a_blocked_motor_trips_by_its_following_error(on: LoopedDrive) -> None:
    on.objects.dictionary[0x6065, 0] = 1000
    on.faults.blocked = True
    on.commands.move(1.0, FAST)
    on.run(1.0)
    assert on.image.alarm_code[0] == 0x8611


def test_a_blocked_motor_reports_no_velocity(on: LoopedDrive) -> None:
    on.faults.blocked = True
    on.commands.move(1.0, FAST)
    on.run(0.3)
    assert on.image.position_command[0] > 0.01
    assert on.image.position[0] == pytest.approx(0.0, abs=1e-6)
    assert on.image.velocity[0] == 0.0


def test_a_statusword_that_never_changes_ends_in_a_time_out() -> None:
    looped = LoopedDrive()
    looped.faults.statusword = 0x0240
    with pytest.raises(DeviceTimeout, match=r"did not go on within 0.5 s, statusword 0x0240"):
        looped.commands.enable(0.5)


def test_a_lost_node_is_offline_with_its_cause(on: LoopedDrive) -> None:
    on.objects.node.online, on.objects.node.fault = False, "no frame for 20 ms"
    on.run(0.02)
    assert on.image.offline[0]
    assert on.image.reason[0] == "node 1: no frame for 20 ms"
    with pytest.raises(NotReady, match="node 1: no frame for 20 ms"):
        on.commands.move(1.0, FAST)


def test_an_image_that_was_forgotten_is_filled_again(on: LoopedDrive) -> None:
    on.image.forget()
    on.run(0.01)
    assert on.image.servo_on[0]
    assert not on.image.offline[0]


def test_a_node_that_returns_holds_its_position(on: LoopedDrive) -> None:
    on.commands.move(1.0, FAST)
    on.run(0.3)
    on.objects.node.online = False
    on.run(0.1)
    assert on.axis.activity.is_idle
    on.objects.node.online = True
    on.axis.resume()
    on.run(0.1)
    assert on.image.velocity_command[0] == 0.0


def test_a_node_that_returns_continues_where_it_has_got_to(on: LoopedDrive) -> None:
    """Its first values after the loss count: the command of before would be a jump."""
    on.objects.node.online = False
    on.run(0.1)
    on.objects.dictionary[DEMAND, 0] = on.objects.dictionary[POSITION, 0] = 30_000
    on.objects.node.online = True
    on.objects.take()
    on.axis.resume()
    assert on.axis.setpoint.position == pytest.approx(0.3)


def test_the_second_axis_of_a_drive_has_objects_of_its_own() -> None:
    looped = LoopedDrive(axis_offset=1, polarity=-1)
    looped.commands.enable(1.0)
    looped.commands.move(0.2, FAST)
    idle(looped)
    assert looped.objects.dictionary[0x6864, 0] == pytest.approx(-20_000, abs=200)
    assert looped.objects.dictionary[0x6064, 0] == 0


def test_an_endless_axis_runs_over_32_bits() -> None:
    looped = LoopedDrive(counts_per_rad=1e9)
    looped.commands.enable(1.0)
    for target in (1.5, 3.0):  # 3e9 counts, beyond 2³¹
        looped.commands.move(target, FAST)
        idle(looped)
    assert looped.image.position[0] == pytest.approx(3.0, abs=1e-3)


@pytest.mark.parametrize("target", [3.0, -3.0])
def test_a_target_that_wraps_to_another_place_is_rejected(target: float) -> None:
    looped = LoopedDrive(counts_per_rad=1e9)
    looped.commands.enable(1.0)
    text = f"target {target:g} is 3000000000 counts away, which has to be less than 2\\^31"
    with pytest.raises(InvalidArgument, match=text):
        looped.commands.move(target, FAST)
    looped.run(1.0)
    assert looped.axis.activity.is_idle
    assert looped.drive.position == 0.0


def test_the_command_mode_is_kept_for_the_next_stream(on: LoopedDrive) -> None:
    on.commands.set_mode(CommandMode.VELOCITY)
    on.run(0.02)
    assert on.image.mode[0] == CommandMode.VELOCITY
    assert on.axis.report.displayed_mode == OperationMode.PROFILE_VELOCITY


def test_torque_is_in_newton_metres_of_the_joint(on: LoopedDrive) -> None:
    on.commands.jog(FAST)
    on.run(1.0)
    assert on.image.torque[0] == pytest.approx(on.drive.torque, abs=0.1)
    assert not math.isnan(on.image.torque[0])


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


def test_the_search_for_a_second_node_is_part_of_the_time_out() -> None:
    looped, searches = LoopedDrive(), list[float]()

    def search(timeout_s: float) -> None:
        searches.append(timeout_s)
        looped.run(0.6)

    looped.objects.require_unique = search  # type: ignore[method-assign]
    looped.faults.statusword = 0x0650  # switch on disabled, whatever happens
    began_ns = looped.clock.now_ns()
    with pytest.raises(DeviceTimeout, match="the servo did not go on within 1 s"):
        looped.commands.enable(1.0)
    took_s = (looped.clock.now_ns() - began_ns) / NANOSECONDS
    assert (searches, took_s) == ([1.0], pytest.approx(1.0, abs=0.02))


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


def test_a_missing_mode_names_the_option() -> None:
    looped = LoopedDrive()
    looped.objects.dictionary[SUPPORTED_MODES, 0] = 1 << 7
    with pytest.raises(OperationError, match="velocity_mode needs profile_velocity"):
        set_up(looped.axis, 0.004)


def test_option_codes_are_written_where_the_drive_has_them() -> None:
    looped = LoopedDrive()
    del looped.objects.dictionary[0x605D, 0]
    looped.objects.written.clear()
    set_up(looped.axis, 0.002)
    written = {index for index, _, _ in looped.objects.written}
    assert written == {0x6007, 0x605A, 0x6085, 0x60C2}
    assert (0x60C2, 1, 2) in looped.objects.written  # milliseconds
    assert (0x60C2, 2, -3) in looped.objects.written


def test_the_interpolation_period_is_exact_where_it_can_be() -> None:
    for period_s in (0.001, 0.002, 0.004, 0.0025, 0.05):
        value, exponent = interpolation_period(period_s)
        assert value * 10.0**exponent == pytest.approx(period_s)
    assert interpolation_period(1 / 300) == (3, -3)
    assert interpolation_period(0.004) == (4, -3)


def test_a_drive_that_is_lost_during_a_command_is_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not an alarm that is still there after 5 s, said after a tenth of them."""
    looped = LoopedDrive()
    looped.faults.statusword = 0x0208  # fault, whatever the controlword
    looped.run(0.05)
    exchange, last = looped._exchange, looped.objects.frames + 100

    def exchange_until_lost() -> None:
        exchange()
        if looped.objects.frames == last:
            looped.objects.node.online, looped.objects.node.fault = (
                False,
                "it went to SafeOp by itself",
            )

    monkeypatch.setattr(looped, "_exchange", exchange_until_lost)
    with pytest.raises(NotReady, match="node 1: it went to SafeOp by itself"):
        looped.commands.clear_alarm(5.0)
