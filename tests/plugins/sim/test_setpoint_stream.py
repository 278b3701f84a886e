from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from tests.plugins.sim.harness import PROFILE, TICK_S, Harness, closed_rig, harness, robot

from robotd.api import CommandMode, NotReady, Operation
from robotd.arrays import FloatArray
from robotd.descriptor import load_robot_descriptor

PERIOD_S = 0.002


def stream(made: Harness, path: CubicSpline, jitter_s: FloatArray) -> FloatArray:
    """Follow ``path`` on axis 0 with calls early or late by ``jitter_s``; the velocities seen."""
    speed = path.derivative()
    start_ns = made.clock.now_ns()
    made.axes.begin_stream([0])
    seen = []
    for index, jitter in enumerate(jitter_s):
        due_ns = start_ns + round((index * PERIOD_S + jitter) * 1e9)
        while made.clock.now_ns() + 1_000_000 <= due_ns:
            seen.append(made.look(TICK_S).velocity[0])
        made.clock.sleep_until_ns(due_ns)
        then = (index + 1) * PERIOD_S
        made.axes.stream(
            np.array([path(then), np.nan]),
            np.array([speed(then), np.nan]),
            start_ns + round(then * 1e9),
        )
    return np.array(seen)


def due(made: Harness, period_s: float = PERIOD_S) -> int:
    """One period from now."""
    return made.clock.now_ns() + round(period_s * 1e9)


def swing(seconds: float) -> CubicSpline:
    times = np.linspace(0, seconds, 21)
    return CubicSpline(times, 0.3 * (1 - np.cos(2 * math.pi * times)), bc_type="clamped")


def test_a_trajectory_of_twenty_points_ends_within_a_milliradian() -> None:
    made = harness()
    stream(made, swing(1.5), np.zeros(round(1.5 / PERIOD_S)))
    made.look(PERIOD_S)
    made.axes.end_stream([0])
    image = made.look()
    assert image.operation[0] == Operation.IDLE
    assert image.motion_complete[0]
    assert image.position_command[0] == pytest.approx(0.6, abs=1e-9)
    assert image.position[0] == pytest.approx(0.6, abs=1e-3)
    assert made.look(0.2).position[0] == pytest.approx(0.6, abs=1e-5)
    assert image.position[1] == 0
    made.axes.move(0, 0.0, PROFILE)
    assert made.look(2.0).motion_complete[0]


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_velocity_is_smooth_although_the_calls_jitter(seed: int) -> None:
    jitter = np.random.default_rng(seed).uniform(-0.0004, 0.0004, 500)
    jitter[0] = 0.0
    velocity = stream(harness(), swing(1.0), jitter)
    # the path itself accelerates by up to 0.3 · (2π)² = 12 rad/s²
    assert np.abs(np.diff(velocity)).max() < 25 * TICK_S


def test_a_stream_that_ends_without_a_word_is_stopped_by_the_device() -> None:
    made = harness(stream_timeout_s=0.05)
    stream(made, swing(1.0), np.zeros(100))  # breaks off at 1.8 rad/s
    record = made.record(0.4)
    operation = record.operation[:, 0]
    assert operation[45] == Operation.STREAM
    assert operation[60] == Operation.IDLE
    assert made.image.reason[0] == "setpoints stayed away"
    assert record.command[5:, 0] == pytest.approx(record.command[5, 0]), "it holds"
    assert not made.image.motion_complete[0]
    resting = made.image.position[0]
    made.axes.stream(np.array([0.0, 0.0]), np.zeros(2), due(made))  # the stream is over
    assert made.look(0.1).position[0] == pytest.approx(resting, abs=1e-5)


def test_an_overdue_setpoint_is_passed_with_its_velocity_for_a_period_and_a_half() -> None:
    made = closed_rig(descriptor=robot(cycle={"rate_hz": 300.0}))
    made.device.open()
    made.device.start_communication(1.0)
    made.enable()
    made.axes.begin_stream([0])
    made.look()
    made.axes.stream(np.array([0.001, 0.0]), np.array([0.5, 0.0]), due(made, 1 / 300))
    image = made.look(0.008)
    assert image.velocity_command[0] == pytest.approx(0.5)
    assert image.position_command[0] == pytest.approx(0.001 + 0.5 * (0.008 - 1 / 300))
    image = made.look(0.02)
    assert image.velocity_command[0] == 0.0
    assert image.position_command[0] == pytest.approx(0.001 + 0.5 * 1.5 / 300)


def test_an_axis_in_velocity_mode_keeps_the_velocity_of_an_overdue_setpoint() -> None:
    made = harness(stream_timeout_s=0.05)
    made.axes.set_command_mode(0, CommandMode.VELOCITY)
    made.axes.begin_stream([0])
    made.axes.stream(np.array([np.nan, np.nan]), np.array([0.5, np.nan]), due(made))
    assert made.look(0.04).velocity_command[0] == pytest.approx(0.5)
    assert made.look(0.4).velocity_command[0] == 0.0, "it is stopped by the device"


def test_an_axis_may_wait_for_its_first_setpoint_for_long() -> None:
    made = harness(stream_timeout_s=0.05)
    made.axes.begin_stream([0, 1])
    assert (made.look(5.0).operation == Operation.STREAM).all()


def test_an_axis_that_joins_leaves_the_overdue_setpoint_of_another_one_as_it_is() -> None:
    made = harness(stream_timeout_s=0.05)
    made.axes.jog(1, PROFILE)
    made.axes.begin_stream([0])
    made.look(0.5)
    made.axes.stream(np.array([0.002, np.nan]), np.array([0.5, np.nan]), due(made))
    made.look(TICK_S)
    made.axes.begin_stream([1])
    record = made.record(0.003)
    assert record.command_velocity[1:, 0] == pytest.approx(0.5)
    assert record.command_velocity[:, 1] == pytest.approx(2.0)
    for axis in (0, 1):
        steps = np.diff(record.command[1:, axis])
        assert steps == pytest.approx(record.command_velocity[2:, axis] * TICK_S)
    record = made.record(0.4)
    assert (record.operation[-1] == Operation.IDLE).all()  # the time-out is in force


def test_a_stream_takes_over_a_move_and_refuses_other_commands() -> None:
    made = harness()
    made.axes.move(0, 1.0, PROFILE)
    before = made.look(0.3).velocity_command[0]
    made.axes.begin_stream([0])
    assert made.look(TICK_S).velocity_command[0] == before
    with pytest.raises(NotReady, match="while it is stream"):
        made.axes.move(0, 1.0, PROFILE)
    made.axes.stop([0])
    assert made.look().operation[0] == Operation.STOPPING
    with pytest.raises(NotReady, match="while it is stopping"):
        made.axes.begin_stream([0])


def test_ending_a_stream_in_motion_brakes() -> None:
    made = harness()
    made.axes.move(0, 0.0, PROFILE)  # its deceleration is not the stream's
    made.look(0.1)
    stream(made, swing(1.0), np.zeros(100))
    made.axes.end_stream([0])
    record = made.record(0.4)
    assert record.operation[0, 0] == Operation.STOPPING
    steepest = np.abs(np.diff(record.command_velocity[:, 0])).max()
    assert steepest == pytest.approx(10.0 * TICK_S)
    assert not made.image.motion_complete[0]


def test_servo_off_ends_the_stream_of_that_axis_alone() -> None:
    made = harness()
    made.axes.begin_stream([0, 1])
    made.axes.servo(0, False, 1.0)
    assert list(made.look().operation) == [Operation.IDLE, Operation.STREAM]


@pytest.mark.parametrize("rate_hz", [50.0, 300.0, 2000.0])
def test_the_period_need_not_be_a_multiple_of_the_fieldbus_cycle(rate_hz: float) -> None:
    made = closed_rig(descriptor=robot(cycle={"rate_hz": rate_hz}))
    made.device.open()
    made.device.start_communication(1.0)
    made.enable()
    made.axes.begin_stream([0])
    start_ns = made.clock.now_ns()
    commands = []
    for index in range(1, round(rate_hz)):
        speed = min(1.0, 4 * index / rate_hz)
        distance = 2 * (index / rate_hz) ** 2 if speed < 1 else index / rate_hz - 0.125
        due_ns = start_ns + round(index / rate_hz * 1e9)
        made.axes.stream(np.array([distance, 0.0]), np.array([speed, 0.0]), due_ns)
        made.clock.sleep_until_ns(start_ns + round(index / rate_hz * 1e9))
        commands.append(made.look().velocity_command[0])
    assert commands[-10:] == pytest.approx([1.0] * 10, abs=1e-6)


def by_velocity(axes: int = 2) -> Harness:
    made = harness(axes)
    for axis in range(axes):
        made.axes.set_command_mode(axis, CommandMode.VELOCITY)
    made.look()
    return made


def test_in_velocity_mode_an_axis_changes_evenly_to_the_velocity_of_its_setpoint() -> None:
    made = by_velocity()
    made.axes.begin_stream([0])
    nowhere = np.full(2, np.nan)
    speeds = [0.0, 0.004, 0.008, 0.008, 0.008, 0.002]
    seen = []
    for speed in speeds:
        made.axes.stream(nowhere, np.array([speed, np.nan]), due(made))
        ticks = range(round(PERIOD_S / TICK_S))
        seen += [made.look(TICK_S).velocity_command[0] for _ in ticks]
    middles = np.convolve([0.0, *speeds], [0.5, 0.5], "valid")
    expected = np.column_stack([middles, speeds]).ravel()
    assert seen == pytest.approx(expected, abs=1e-12)
    travel = float(np.sum(middles) * PERIOD_S)
    assert made.simulation.servo.command[0] == pytest.approx(travel, abs=1e-12)


def test_in_velocity_mode_the_end_of_a_stream_slows_to_rest() -> None:
    made = by_velocity()
    made.axes.begin_stream([0, 1])
    for _ in range(100):
        made.axes.stream(np.full(2, np.nan), np.array([1.0, -1.0]), due(made))
        made.look(PERIOD_S)
    made.axes.end_stream([0, 1])
    assert list(made.look().operation) == [Operation.STOPPING] * 2
    record = made.record(0.2)
    assert np.abs(np.diff(record.command_velocity[:, 0])).max() == pytest.approx(10.0 * TICK_S)
    assert list(record.command_velocity[-1]) == [0.0, 0.0]
    assert list(record.operation[-1]) == [Operation.IDLE] * 2


def test_a_steering_axis_stops_with_the_ramp_of_steering() -> None:
    """The wheel of this base has 10 rad/s², the steering 6."""
    descriptor = load_robot_descriptor("tricycle_base")
    made, period_s = closed_rig(descriptor=descriptor), 1 / descriptor.cycle.rate_hz
    made.device.open()
    made.device.start_communication(1.0)
    made.enable()
    made.axes.begin_stream([1])
    position, speed = 0.0, 1.2
    for _ in range(40):
        position += speed * period_s
        setpoint = np.array([np.nan, position]), np.array([np.nan, speed])
        made.axes.stream(*setpoint, due(made, period_s))
        made.look(period_s)
    made.axes.stop([1])
    record = made.record(0.5)
    braking_s = (record.operation[:, 1] == Operation.STOPPING).sum() * TICK_S
    assert braking_s == pytest.approx(speed / 6.0, abs=3 * TICK_S)
