from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.plugins.sim.harness import PROFILE, TICK_S, harness

from robotd.api import DeviceTimeout, NotReady, Operation, OperationError, Profile
from robotd_sim.fault_injector import SimFaultInjector


def test_enabling_is_bumpless_wherever_the_axis_was_put() -> None:
    made = harness(on=False)
    made.faults.move_by_hand(0, 0.7)
    made.axes.servo(0, True, 1.0)
    record = made.record(0.3)
    assert np.ptp(record.position[:, 0]) == 0
    assert record.command[:, 0] == pytest.approx(0.7, abs=1e-5)
    assert not record.velocity.any()
    with pytest.raises(NotReady, match="by hand"):
        made.faults.move_by_hand(0, 0.0)


def test_a_drive_takes_some_cycles_to_enable_and_a_timeout_names_the_axis() -> None:
    made = harness(on=False)
    before_ns = made.clock.now_ns()
    made.axes.servo(0, True, 1.0)
    assert 2e6 <= made.clock.now_ns() - before_ns <= 6e6
    with pytest.raises(DeviceTimeout, match=r"axis 1: the servo did not go on within 0 s"):
        made.axes.servo(1, True, 0.0)


def test_the_last_request_counts() -> None:
    made = harness(on=False)
    with pytest.raises(DeviceTimeout):
        made.axes.servo(0, True, 0.0)
    made.axes.servo(0, False, 1.0)
    assert not made.look(0.1).servo_on[0]


def test_without_servo_the_axis_coasts_and_its_command_follows() -> None:
    made = harness(coast_deceleration_rad_s2=4.0)
    made.axes.jog(0, PROFILE)
    made.look(1.0)
    made.axes.servo(0, False, 1.0)
    start = made.look()
    position, velocity = start.position[0], start.velocity[0]
    assert start.operation[0] == Operation.IDLE
    assert not start.motion_complete[0]
    record = made.record(0.6)
    assert record.position[-1, 0] - position == pytest.approx(velocity**2 / 8, abs=1e-5)
    assert np.abs(np.diff(record.velocity[:, 0])).max() <= 4.0 * TICK_S + 1e-9
    assert (record.command == record.position).all()
    assert not made.image.torque.any()


def test_a_coasting_axis_that_is_blocked_stays_there_when_it_is_let_go() -> None:
    made = harness(coast_deceleration_rad_s2=1.0)
    made.axes.jog(0, PROFILE)
    made.look(1.0)
    made.axes.servo(0, False, 1.0)
    held = made.look(0.1).position[0]
    made.faults.block(0, True)
    assert made.look(1.0).position[0] == held
    made.faults.block(0, False)
    image = made.look(1.0)
    assert image.position[0] == image.position_command[0] == held


def test_a_coasting_axis_is_caught_without_a_jump_if_it_is_slow_enough() -> None:
    made = harness(coast_deceleration_rad_s2=4.0, feedforward=0.0)
    made.set(QuickStopDec=20.0, ServoOnFollowingError=100)
    made.axes.jog(0, PROFILE)
    made.look(1.0)
    made.axes.servo(0, False, 1.0)
    with pytest.raises(NotReady, match=r"axis 0.*counts a cycle.*allows 100"):
        made.axes.servo(0, True, 1.0)
    made.look(0.37)  # about 0.5 rad/s left, 83 counts a cycle
    speed = made.look().velocity[0]
    made.axes.servo(0, True, 1.0)
    assert made.look().velocity[0] == pytest.approx(speed, abs=20.0 * 0.004)
    record = made.record(0.2)
    assert np.abs(np.diff(record.velocity[:, 0])).max() <= 20.0 * TICK_S + 1e-6
    assert made.image.operation[0] == Operation.IDLE
    assert made.image.velocity[0] == 0


def test_an_alarm_drops_the_servo_and_refuses_everything_until_cleared() -> None:
    made = harness()
    made.axes.move(0, 1.0, PROFILE)
    made.look(0.2)
    made.faults.trip(0, 0x7500)
    image = made.look()
    assert image.amp_alarm[0]
    assert image.alarm_code[0] == 0x7500
    assert image.reason == ["error 0x7500", ""]
    assert not image.servo_on[0]
    assert image.servo_on[1]
    with pytest.raises(NotReady, match="axis 0: the drive is in alarm 29952"):
        made.axes.servo(0, True, 1.0)
    made.axes.clear_alarm(0, 1.0)
    image = made.look(1.0)
    assert not image.amp_alarm[0]
    assert image.alarm_code[0] == 0
    assert image.reason == ["", ""]
    assert not image.servo_on[0]  # nothing comes back by itself
    made.axes.servo(0, True, 1.0)
    made.axes.move(0, 0.0, PROFILE)
    assert made.look(2.0).motion_complete[0]


def test_the_parameter_file_may_keep_the_servo_on_during_an_alarm() -> None:
    made = harness()
    made.set(ServoOffDuringAmpAlarm=0, QuickStopDec=20.0)
    made.axes.jog(0, Profile(1.0, 10.0, 10.0))
    made.look(0.5)
    made.faults.trip(0, 1)
    assert made.look(0.02).operation[0] == Operation.STOPPING
    image = made.look(0.1)
    assert image.servo_on[0]
    assert image.operation[0] == Operation.IDLE


def test_an_alarm_before_the_drive_obeys_keeps_it_off() -> None:
    made = harness(on=False)
    with pytest.raises(DeviceTimeout):
        made.axes.servo(0, True, 0.0)
    made.faults.trip(0, 1)
    assert not made.look(0.1).servo_on[0]


def test_a_lost_slave_hides_an_alarm_until_it_is_back() -> None:
    made = harness()
    made.faults.trip(0, 0x3210)
    assert made.look().reason == ["DC link over-voltage", ""]
    made.faults.disconnect(0)
    assert made.look().reason == ["slave 0 does not answer: cable or power supply", ""]
    made.faults.trip(0, 0x3210)
    assert made.look().reason == ["slave 0 does not answer: cable or power supply", ""]
    made.faults.reconnect(0)
    with made.simulation.world.lock:
        made.simulation.reconnect()
    assert made.look().reason == ["DC link over-voltage", ""]


@pytest.mark.parametrize(
    "lose", [lambda faults: faults.disconnect(0), SimFaultInjector.drop_communication]
)
def test_an_axis_that_is_lost_while_it_homes_has_no_home(
    lose: Callable[[SimFaultInjector], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = harness(on=False)
    sleep = made.clock.sleep_until_ns

    def lose_and_sleep(deadline_ns: int) -> None:  # ``home`` waits for the drive
        lose(made.faults)
        sleep(deadline_ns)

    monkeypatch.setattr(made.clock, "sleep_until_ns", lose_and_sleep)
    with pytest.raises(OperationError, match="homing was interrupted"):
        made.axes.home(0, 1.0)
    assert not made.look().home_done[0]
