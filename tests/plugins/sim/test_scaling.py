from __future__ import annotations

import math

import numpy as np
import pytest
from tests.plugins.sim.harness import PROFILE, TICK_S, harness

from robotd.api import NotReady, Operation


def test_positions_come_in_whole_counts() -> None:
    made = harness(encoder_counts_per_turn=1024)
    made.axes.move(0, 0.01, PROFILE)
    image = made.look(1.0)
    count = 2 * math.pi / 1024
    assert image.position[0] == pytest.approx(2 * count)
    assert image.position_command[0] == 0.01


def test_polarity_changes_the_sign_of_the_position() -> None:
    made = harness(on=False)
    made.faults.move_by_hand(0, 0.5)
    made.axes.set_polarity(0, -1)
    image = made.look()
    assert image.position[0] == pytest.approx(-0.5, abs=1e-5)
    made.axes.servo(0, True, 1.0)
    made.axes.move(0, -0.25, PROFILE)
    assert made.look(1.0).position[0] == pytest.approx(-0.25, abs=1e-5)


def test_twice_the_gear_ratio_is_half_the_position() -> None:
    made = harness(on=False)
    made.faults.move_by_hand(1, 1.0)
    made.axes.set_gear_ratio(1, 2.0**21, 2 * math.pi)
    image = made.look()
    assert image.position[1] == pytest.approx(0.5, abs=1e-5)
    assert image.position[0] == 0
    assert "AxisGearRatioNumerator = 2097152" in made.device.dump_parameters(1)
    made.enable()
    with pytest.raises(NotReady, match="axis 1: its scale cannot be changed while the servo is on"):
        made.axes.set_gear_ratio(1, 1.0, 1.0)


def test_an_incremental_encoder_wakes_up_at_zero_without_its_home() -> None:
    made = harness()
    made.axes.move(0, 1.0, PROFILE)
    made.look(2.0)
    made.axes.home(1, 1.0)
    made.device.stop_communication(1.0)
    assert not made.look().home_done[1]
    made.device.start_communication(1.0)
    assert made.look().position[0] == pytest.approx(0.0, abs=1e-5)


def test_an_absolute_encoder_keeps_its_value_and_its_home_position() -> None:
    made = harness()
    made.set(AbsoluteEncoderMode=1, ClearHomeDoneOnCommStop=0)
    for axis, target in ((0, 1.0), (1, 0.5)):
        made.axes.move(axis, target, PROFILE)
    made.look(2.0)
    made.axes.home(1, 1.0)
    made.device.stop_communication(1.0)
    made.device.start_communication(1.0)
    image = made.look()
    assert image.position == pytest.approx([1.0, 0.0], abs=1e-5)
    assert list(image.home_done) == [False, True]


def test_turns_beyond_32_bits_are_counted_while_running_and_lost_over_a_restart() -> None:
    made = harness(on=False, encoder_counts_per_turn=2**20)
    made.set(AbsoluteEncoderMode=1)
    turn = 2 * math.pi
    made.faults.move_by_hand(0, 2050 * turn)  # 32 bits hold ±2048 turns
    assert made.look().position[0] == pytest.approx(2050 * turn)
    made.device.stop_communication(1.0)
    made.device.start_communication(1.0)
    assert made.look().position[0] == pytest.approx((2050 - 4096) * turn)


def test_homing_makes_the_present_position_the_home_position_without_moving() -> None:
    made = harness()
    made.axes.move(0, 1.0, PROFILE)
    with pytest.raises(NotReady, match="axis 0: it cannot be homed while it is moving"):
        made.axes.home(0, 1.0)
    made.look(2.0)
    made.axes.home(0, 1.0)
    image = made.look()
    assert image.home_done[0]
    assert image.position[0] == 0
    assert image.position_command[0] == pytest.approx(0.0, abs=1e-5)
    assert image.operation[0] == Operation.IDLE
    record = made.record(0.1)
    assert np.abs(record.velocity).max() < 1e-6
    made.set(HomePosition=0.25, ClearHomeDoneOnServoOff=1)
    made.axes.home(0, 1.0)
    assert made.look().position[0] == pytest.approx(0.25, abs=1e-5)
    made.axes.servo(0, False, 1.0)
    assert not made.look().home_done[0]


@pytest.mark.parametrize("absolute", [0, 1])
def test_the_joints_start_where_the_options_say(absolute: int) -> None:
    made = harness(on=False, initial_position_rad=(0.5, -1.0))
    made.set(AbsoluteEncoderMode=absolute)
    assert made.look().position == pytest.approx([0.5, -1.0], abs=1e-5)


def test_incremental_encoders_start_where_the_options_say() -> None:
    made = harness(initial_position_rad=(0.5, -1.0))
    assert made.look().position == pytest.approx([0.5, -1.0], abs=1e-5)


def test_an_axis_that_coasts_while_its_encoder_wakes_up_goes_on_without_a_jump() -> None:
    made = harness(1, coast_deceleration_rad_s2=2.0)
    made.axes.jog(0, PROFILE)
    made.look(1.0)
    made.faults.drop_communication()
    made.device.start_communication(1.0)
    made.look()
    record = made.record(2.0)
    assert record.velocity[0, 0] > 1.9
    assert record.velocity[-1, 0] == 0.0
    steps = np.diff(record.position[:, 0])
    assert np.abs(steps).max() < 1.01 * record.velocity.max() * TICK_S
