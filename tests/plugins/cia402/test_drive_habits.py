"""Habits of real drives that must not become motion: late modes, lost answers, own stops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import pytest
from tests.plugins.cia402.looped_drive import FAST, LoopedDrive, idle, peak_velocity

from robotd.api import CommandMode, DeviceTimeout, InvalidArgument, OperationError, Profile
from robotd_cia402.controlword import Control, DriveState, StatusBits
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import DEMAND, INPUTS, MODE, STATUSWORD, VELOCITY
from robotd_cia402.simulated.drive import SimulatedState
from robotd_cia402.simulated.mode_motion import Mode


def change_modes_late(looped: LoopedDrive, frames: int) -> None:
    """Let the drive change its mode some frames after the request."""
    send, requested = looped.objects.send, [looped.objects.dictionary[MODE, 0]] * frames

    def late() -> None:
        send()
        requested.append(looped.objects.dictionary[MODE, 0])
        looped.objects.dictionary[MODE, 0] = requested.pop(0)

    looped.objects.send = late  # type: ignore[method-assign]


def test_a_drive_that_leaves_homing_late_does_not_home_again() -> None:
    """Bit 4 enables interpolation in one mode, and starts a homing in the other."""
    looped = LoopedDrive(stream_mode="ip", homing_method=37)
    looped.commands.enable(1.0)
    begin, begun = looped.drive.motion._begin_homing, list[int]()

    def note(method: int) -> None:
        begun.append(method)
        begin(method)

    looped.drive.motion._begin_homing = note  # type: ignore[method-assign]
    change_modes_late(looped, 5)
    looped.commands.home(5.0)
    looped.run(0.2)
    assert looped.axis.report.displayed_mode == OperationMode.INTERPOLATED_POSITION
    assert begun == [37]


def test_a_quick_stop_of_the_drive_itself_within_a_stop_is_not_left() -> None:
    """The setpoint of the stop comes to rest further on: leaving would be a jump."""
    looped = LoopedDrive(stop_deceleration_rad_s2=2.0)
    looped.commands.enable(1.0)
    looped.commands.prepare_stream()
    looped.commands.begin_stream()
    for step in range(100):
        looped.axis.follow(0.004 * step, 1.0)
        looped.run(0.004)
    looped.commands.stop()
    looped.run(0.02)
    enter = looped.drive._enter
    enter(SimulatedState.QUICK_STOP_ACTIVE)
    looped.drive._enter = lambda state: None  # type: ignore[method-assign]
    looped.run(1.0)
    rest = looped.drive.position
    looped.drive._enter = enter  # type: ignore[method-assign]
    assert peak_velocity(looped, 100) < 0.01
    looped.commands.enable(1.0)
    assert looped.axis.report.state is DriveState.OPERATION_ENABLED
    assert peak_velocity(looped, 100) < 0.01
    assert looped.drive.position == pytest.approx(rest, abs=1e-4)


def test_a_move_that_is_not_taken_ends_at_rest() -> None:
    """The drive is halted then, out of the move before; idle, a stream would begin with a jump."""
    looped = LoopedDrive()
    looped.commands.enable(1.0)
    looped.commands.move(9.0, Profile(velocity=2.0, acceleration=5.0, deceleration=1.0))
    looped.run(0.6)
    handlers = looped.drive.motion._handlers
    profile_position = handlers[Mode.PROFILE_POSITION]

    def deaf(rising: int, word: int, period_s: float) -> None:
        profile_position(rising & ~0x10, word, period_s)

    handlers[Mode.PROFILE_POSITION] = deaf
    looped.commands.move(0.0, Profile(velocity=2.0, acceleration=5.0, deceleration=1.0))
    looped.run(1.1)
    assert looped.axis.mode.bits & Control.HALT
    idle(looped)
    assert looped.motors.velocity(0) == pytest.approx(0.0, abs=0.02)
    assert looped.image.position_command[0] == pytest.approx(looped.drive.position, abs=1e-3)
    assert not looped.axis.activity.complete


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_position_demand_that_stands_still_in_velocity_modes_is_no_place_to_go(
    velocity_mode: str,
) -> None:
    """Object 0x6062 comes from the position controller, which does not run in these modes."""
    looped = LoopedDrive(velocity_mode=velocity_mode)
    take = looped.objects.take

    def keep_demand() -> None:
        before = looped.objects._taken[INPUTS.index(DEMAND)]
        take()
        if looped.drive.motion.mode in (Mode.PROFILE_VELOCITY, Mode.CYCLIC_VELOCITY):
            looped.objects._taken[INPUTS.index(DEMAND)] = before

    looped.objects.take = keep_demand  # type: ignore[method-assign]
    looped.commands.set_mode(CommandMode.VELOCITY)
    looped.commands.enable(1.0)
    looped.commands.jog(FAST)
    looped.run(1.0)
    looped.commands.stop()
    idle(looped)
    rest = looped.drive.position
    looped.commands.set_mode(CommandMode.POSITION)
    assert peak_velocity(looped, 50) < 0.05
    assert looped.drive.position == pytest.approx(rest, abs=1e-3)


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_jog_that_is_stopped_before_it_begins_makes_no_stop_longer(velocity_mode: str) -> None:
    looped = LoopedDrive(velocity_mode=velocity_mode)
    looped.commands.set_mode(CommandMode.VELOCITY)
    looped.commands.enable(1.0)
    looped.commands.jog(Profile(velocity=2.0, acceleration=20.0, deceleration=10.0))
    looped.run(0.5)
    before, require_power = looped.drive.position, looped.commands._require_power

    def stop_meanwhile() -> None:
        looped.commands.stop()
        require_power()

    looped.commands._require_power = stop_meanwhile  # type: ignore[method-assign]
    with pytest.raises(OperationError, match="stopped before the motion began"):
        looped.commands.jog(Profile(velocity=2.0, acceleration=20.0, deceleration=1.0))
    idle(looped)
    assert looped.drive.position - before == pytest.approx(2.0**2 / 2 / 10.0, abs=0.03)


def test_an_object_is_written_again_after_an_answer_that_did_not_come() -> None:
    """The drive may have taken it: its speed is not the one of before."""
    looped = LoopedDrive()
    looped.commands.enable(1.0)
    looped.commands.move(0.1, FAST)
    idle(looped)
    write = looped.objects.write

    def without_answer(index: int, sub: int, value: int) -> None:
        write(index, sub, value)
        raise DeviceTimeout("no answer")

    looped.objects.write = without_answer  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout, match="no answer"):
        looped.commands.move(0.2, Profile(velocity=5.0, acceleration=5.0, deceleration=5.0))
    looped.objects.write = write  # type: ignore[method-assign]
    looped.commands.move(2.0, FAST)
    assert peak_velocity(looped, 400) == pytest.approx(FAST.velocity, abs=0.05)


def test_the_servo_goes_on_in_no_torque_mode_that_the_drive_leaves_late() -> None:
    """The torque is 0: an arm would fall until the mode changes, and jump back."""
    looped = LoopedDrive()
    looped.commands.set_mode(CommandMode.TORQUE)
    looped.commands.enable(1.0)
    looped.commands.prepare_stream()
    looped.commands.begin_stream()
    change_modes_late(looped, 100)
    looped.drive.trip(0x3210)
    looped.run(0.1)
    looped.commands.clear_alarm(1.0)
    exchange, modes, drive = looped._exchange, list[Mode](), looped.drive

    def note() -> None:
        drive.motion.prepare(Mode.of(looped.objects.dictionary[MODE, 0]))  # with the servo off, too
        exchange()
        if drive.state is SimulatedState.OPERATION_ENABLED:
            modes.append(drive.motion.mode)

    looped._exchange = note  # type: ignore[method-assign]
    looped.commands.enable(2.0)
    assert set(modes) == {Mode.CYCLIC_POSITION}


def test_an_alarm_is_not_cleared_after_the_time_out() -> None:
    """Its caller has got the error that it is still there."""
    looped = LoopedDrive()
    put, sent = looped.objects.put, list[int]()

    def note(values: Sequence[int]) -> None:
        put(values)
        sent.append(values[0])

    looped.objects.put = note  # type: ignore[method-assign]
    looped.faults.statusword = 0x020F  # fault reaction active
    looped.run(0.1)
    begun_ns = looped.clock.now_ns()
    with pytest.raises(DeviceTimeout, match="the alarm is still there after 1 s"):
        looped.commands.clear_alarm(1.0)
    assert looped.clock.now_ns() - begun_ns < 1.1e9
    assert Control.FAULT_RESET not in sent


def test_a_homing_that_the_drive_goes_on_with_is_ended_by_a_quick_stop() -> None:
    """A drive may start at the rising bit 4 and not watch it from then on."""
    looped = LoopedDrive(homing_method=19, homing_speed_rad_s=0.5, homing_acceleration_rad_s2=2.0)
    looped.commands.enable(1.0)
    handlers = looped.drive.motion._handlers
    homing = handlers[Mode.HOMING]
    handlers[Mode.HOMING] = lambda rising, word, s: homing(rising, word | 0x10, s)
    exchange, speeds = looped._exchange, [0.0]

    def note() -> None:
        exchange()
        speeds.append(looped.motors.velocity(0))

    looped._exchange = note  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout, match=r"homing by method .* did not end"):
        looped.commands.home(1.0)
    looped.run(0.5)
    ramp = looped.axis.options.quick_stop_deceleration_rad_s2
    assert max(abs(b - a) for a, b in pairwise(speeds)) < 1.5 * ramp * 0.004
    assert looped.axis.activity.is_idle
    assert speeds[-1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_speed_below_the_unit_of_the_drive_is_rejected(velocity_mode: str) -> None:
    """It would be 0: the axis would never arrive, and a homing never end."""
    looped = LoopedDrive(
        velocity_per_rad_s=9.55,
        homing_method=19,
        homing_creep_rad_s=0.05,
        velocity_mode=velocity_mode,
    )
    looped.commands.enable(1.0)
    slow = Profile(velocity=0.05, acceleration=5.0, deceleration=5.0)
    text = r"node 1: a velocity of 0.05 is less than half a unit of the drive, 0.105"
    for command in (
        lambda: looped.commands.move(1.0, slow),
        lambda: looped.commands.jog(slow),
        lambda: looped.commands.home(5.0),
    ):
        with pytest.raises(InvalidArgument, match=text):
            command()
    assert looped.axis.activity.is_idle
    looped.commands.jog(replace(slow, velocity=0.0))
    looped.commands.move(0.1, replace(slow, velocity=0.1))
    idle(looped)


def test_an_emergency_that_the_drive_does_not_end_is_over_with_its_alarm() -> None:
    """Not every drive sends an error reset, and a mailbox may have no room for it."""
    looped = LoopedDrive()
    looped.run(0.1)
    looped.drive.trip(0x3210)
    looped.run(0.1)
    assert "EMCY 0x3210" in looped.image.reason[0]
    looped.drive._emergency = lambda code, register: None
    looped.commands.clear_alarm(1.0)
    assert looped.objects.node.emergency is None
    looped.drive.trip(0x8611)
    looped.run(0.1)
    assert looped.image.reason[0] == "node 1: error code 0x8611 following error"


def test_a_move_does_not_end_by_the_target_reached_of_the_move_before() -> None:
    """A drive may clear the bit some time after it has taken the set-point."""
    looped = LoopedDrive()
    looped.commands.enable(1.0)
    looped.commands.move(0.1, FAST)
    idle(looped)
    take, words = looped.objects.take, [SimulatedState.OPERATION_ENABLED.value | 1 << 10] * 15

    def clear_late() -> None:
        take()
        word = looped.objects._taken[INPUTS.index(STATUSWORD)]
        words.append(word)
        reached = words.pop(0) & StatusBits.TARGET_REACHED
        looped.objects._taken[INPUTS.index(STATUSWORD)] = (
            word & ~StatusBits.TARGET_REACHED | reached
        )

    looped.objects.take = clear_late  # type: ignore[method-assign]
    looped.commands.move(1.1, FAST)
    idle(looped)
    assert looped.motors.velocity(0) == pytest.approx(0.0, abs=0.02)
    assert looped.drive.position == pytest.approx(1.1, abs=1e-3)
    assert looped.axis.activity.complete


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_velocity_that_comes_rarely_shows_no_rest_in_motion(velocity_mode: str) -> None:
    looped = LoopedDrive(velocity_mode=velocity_mode)
    looped.objects.velocity_turn = turn = 50
    take, place = looped.objects.take, INPUTS.index(VELOCITY)

    def rarely() -> None:
        before = looped.objects._taken[place]
        take()
        if looped.objects.frames % turn:
            looped.objects._taken[place] = before

    looped.objects.take = rarely  # type: ignore[method-assign]
    looped.commands.set_mode(CommandMode.VELOCITY)
    looped.commands.enable(1.0)
    while looped.objects.frames % turn:
        looped.run(0.004)
    looped.commands.jog(Profile(velocity=1.0, acceleration=20.0, deceleration=2.0))
    looped.run(0.1)
    looped.commands.stop()
    idle(looped)
    assert looped.motors.velocity(0) == pytest.approx(0.0, abs=0.02)


def test_a_move_that_ends_at_a_limit_of_the_drive_is_not_complete() -> None:
    """The drive reports that its target is reached, and an internal limit."""
    looped = LoopedDrive()
    looped.objects.dictionary[0x607D, 1], looped.objects.dictionary[0x607D, 2] = -20_000, 20_000
    looped.commands.enable(1.0)
    looped.commands.move(1.0, FAST)
    idle(looped)
    assert not looped.axis.activity.complete
    assert looped.image.position_command[0] == pytest.approx(0.2, abs=1e-3)
    looped.commands.move(0.1, FAST)
    idle(looped)
    assert looped.axis.activity.complete
    assert looped.image.position_command[0] == pytest.approx(0.1, abs=1e-5)
