"""Stops of some axes, in every kind of motion: of each named axis alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from robotd.api import AxisDriver, Capability, CommandMode, FloatArray, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import jog, judge, ramped
from robotd_conformance.checks.test_stopping import MORE, REACTION_S, stop_moving

Stop = Callable[[AxisDriver, Sequence[int]], None]
STOPS = [
    pytest.param(AxisDriver.stop, id="stop"),
    pytest.param(AxisDriver.quick_stop, id="quick_stop"),
]
EARLY_S = 0.12  # of a move, when the shortest is far from its end
RUNNING = 0.7  # share of its speed that an axis keeps which was not stopped
SHARE, RAMP_S, STOP_S, LOOK_S, BRAKE_S = 0.2, 0.2, 0.3, 0.6, 0.7  # of a stream


@pytest.fixture(params=STOPS)
def stop(request: pytest.FixtureRequest) -> Stop:
    """``stop`` or ``quick_stop`` of a driver, called by its name."""
    name = request.param.__name__
    return lambda driver, axes: getattr(driver, name)(axes)


def chosen(harness: Harness, named: str) -> list[int]:
    if harness.count < 2:
        pytest.skip(f"the robot {harness.robot.descriptor.name} has one axis")
    if named == "first and last":
        if harness.count < 3:
            pytest.skip("there is no axis between the first and the last one")
        return [harness.count - 1, 0]
    return harness.all[-1:] if named == "last" else harness.all[:0:-1]


@pytest.mark.clause("AxisDriver.move/starts")
@pytest.mark.clause("AxisDriver.stop/starts", "AxisDriver.stop/all-axes")
@pytest.mark.clause("AxisDriver.quick_stop/starts")
@pytest.mark.parametrize("named", ["last", "all but the first", "first and last"])
def test_a_stop_reaches_each_named_axis_of_a_move(harness: Harness, stop: Stop, named: str) -> None:
    axes, start = chosen(harness, named), harness.image.position_command.copy()
    for targets in (start + harness.travel(), start):
        harness.move(harness.all, targets)
        harness.pass_time(EARLY_S)
        stop(harness.drivers.axes, axes)
        harness.rest()
        left = np.abs(harness.image.position - targets)
        assert (left[axes] > 5 * SETTLED_RAD).all(), f"a stop of {axes} did not stop all of them"
        others = [axis for axis in harness.all if axis not in axes]
        assert not harness.off_target(targets, others), f"a stop of {axes} stopped another axis"
        harness.move(harness.all, targets)
        harness.rest()


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stop/all-axes", "AxisDriver.stop/ramp", "AxisDriver.stop/starts")
@pytest.mark.clause("AxisDriver.quick_stop/starts")
def test_a_stop_reaches_each_named_axis_of_jogs(fresh: Harness, stop: Stop) -> None:
    fresh.set_velocity_mode()
    for speeds in (fresh.speeds(SHARE), -fresh.speeds(SHARE)):
        jog(fresh, speeds)
        fresh.pass_time(0.4)
        for axes in ([fresh.count - 1], fresh.all):
            stop(fresh.drivers.axes, axes)
            ramps = [abs(speeds[axis]) / fresh.profile(axis).deceleration for axis in axes]
            fresh.pass_time(
                MORE * max(ramps) + REACTION_S + fresh.response_s + 2 * fresh.feedback_s
            )
            check_stopped(fresh, axes, speeds)
        fresh.rest()


@pytest.mark.clause("AxisDriver.read/measured")
@pytest.mark.clause("AxisDriver.stop/stream", "AxisDriver.stop/all-axes")
@pytest.mark.clause("AxisDriver.quick_stop/starts")
def test_a_stop_reaches_each_named_axis_of_a_stream(streamed: Harness, stop: Stop) -> None:
    start, speeds = streamed.image.position_command.copy(), streamed.speeds(SHARE)

    def setpoint(time_s: float) -> tuple[FloatArray, FloatArray]:
        distance_s, share = ramped(time_s, RAMP_S, BRAKE_S)
        return start + distance_s * speeds, share * speeds

    stop_a_stream(streamed, stop, setpoint, speeds, CommandMode.POSITION)


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stop/stream", "AxisDriver.stop/all-axes")
@pytest.mark.clause("AxisDriver.quick_stop/starts")
def test_a_stop_reaches_each_named_axis_of_a_velocity_stream(fresh: Harness, stop: Stop) -> None:
    fresh.set_velocity_mode()
    speeds, unknown = fresh.speeds(SHARE), np.full(fresh.count, np.nan)

    def setpoint(time_s: float) -> tuple[FloatArray, FloatArray]:
        return unknown, ramped(time_s, RAMP_S, BRAKE_S)[1] * speeds

    stop_a_stream(fresh, stop, setpoint, speeds, CommandMode.VELOCITY)


@pytest.mark.clause("AxisDriver.stop/idle", "AxisDriver.stop/ramp")
@pytest.mark.clause("AxisDriver.quick_stop/idle")
def test_a_repeated_stop_changes_nothing(harness: Harness, stop: Stop) -> None:
    def twice(axes: Sequence[int]) -> None:
        stop(harness.drivers.axes, axes)
        harness.pass_time(0.06)
        stop(harness.drivers.axes, axes)

    speed, time_s, distance = stop_moving(harness, twice)
    ramp_s = np.array([speed[axis] / harness.profile(axis).deceleration for axis in harness.all])
    reaction_s = REACTION_S + harness.response_s
    assert (time_s <= MORE * ramp_s + reaction_s).all(), "the second stop prolonged the first"
    assert (distance <= speed * (MORE * ramp_s / 2 + reaction_s)).all()
    assert harness.image.servo_on.all()


def stop_a_stream(
    harness: Harness,
    stop: Stop,
    setpoint: Callable[[float], tuple[FloatArray, FloatArray]],
    speeds: FloatArray,
    mode: CommandMode,
) -> None:
    """Stream to all axes, stop the last and let the stream go on."""
    last, began_ns, seen = harness.count - 1, harness.clock.now_ns(), list[FloatArray]()

    def send(image: ProcessImage) -> None:
        harness.stream(*setpoint((harness.due_ns - began_ns) * 1e-9))

    claim = harness.robot.axes.claimed("conformance", harness.all, mode)
    with harness.recording() as recording, claim, harness.each_period(send):
        harness.pass_time(STOP_S)
        stop(harness.drivers.axes, [last])
        harness.pass_time(LOOK_S - STOP_S)
        seen.append(harness.image.velocity.copy())
        harness.pass_time(BRAKE_S + RAMP_S + 0.1 - LOOK_S)
    harness.rest()
    moved = np.abs(seen[0]) / np.abs(speeds)
    problems = [f"axis {last} goes on at {moved[last]:.0%}"] if moved[last] > 1 - RUNNING else []
    problems += [
        f"axis {axis} was stopped, too" for axis in harness.all[:-1] if moved[axis] < RUNNING
    ]
    judge(harness, recording, problems)


def check_stopped(harness: Harness, axes: Sequence[int], speeds: FloatArray) -> None:
    """``axes`` stand; the others have ``speeds``."""
    moving = np.abs(harness.image.velocity) > RUNNING * np.abs(speeds)
    standing = np.abs(harness.image.velocity) < 0.1 * np.abs(speeds)
    assert standing[axes].all(), f"a stop of {list(axes)} did not stop all of them"
    assert np.delete(moving, axes).all(), f"a stop of {list(axes)} stopped another axis"
