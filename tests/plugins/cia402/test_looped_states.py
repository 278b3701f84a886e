"""Homing, faults, loss and settings of a simulated drive of the CiA 402 layer, without a bus."""

from __future__ import annotations

import math
import threading

import pytest
from tests.plugins.cia402.looped_drive import (
    FAST,
    SUPPORTED_MODES,
    LoopedDrive,
    idle,
)

from robotd.api import (
    NANOSECONDS,
    CommandMode,
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    RobotdError,
)
from robotd_cia402.drive_setup import interpolation_period, set_up
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import (
    DEMAND,
    POSITION,
)
from robotd_cia402.simulated.mode_motion import Mode


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
    with pytest.raises(DeviceTimeout, match=r"homing by method .* did not end"):
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
    with pytest.raises(DeviceTimeout, match=r"node 1: homing by method 19 .* not end within 0.5 s"):
        looped.commands.home(0.5)


def test_an_unsupported_homing_method_fails() -> None:
    looped = LoopedDrive(homing_method=1)
    looped.commands.enable(1.0)
    with pytest.raises(OperationError, match=r"method 1 .* failed: .* homing error at rest"):
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
