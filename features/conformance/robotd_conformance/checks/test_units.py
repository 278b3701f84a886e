"""Units and signs: a commanded radian is a measured radian, a second is a second."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from robotd.api import Capability, CommandMode, FaultInjector, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import (
    jog,
    judge,
    mean_velocity,
    ramped,
    record_move,
    record_stream,
)
from robotd_conformance.checks.recording import MotionSamples

SPAN_S = 0.02  # over which speeds are measured
LAG_S = 0.03  # granted between a commanded and a measured value
STEPPED_LAG_S = 0.01  # the same of a device that needs no time of its own


@pytest.mark.clause("AxisDriver.move/target", "drivers/units")
def test_a_commanded_radian_is_a_measured_radian(harness: Harness) -> None:
    start = harness.image.position.copy()
    for sign in (1.0, -1.0):
        distance = sign * harness.travel()
        targets = harness.image.position_command + distance
        harness.move(harness.all, targets)
        harness.rest()
        assert not harness.off_target(targets)
    assert not harness.off_target(start)


@pytest.mark.clause("AxisDriver.move/starts")
def test_each_axis_moves_alone(harness: Harness) -> None:
    for axis, distance in zip(harness.all, harness.travel(0.2), strict=True):
        before = harness.image.position.copy()
        harness.move([axis], before + distance)
        harness.rest([axis])
        before[axis] += distance
        assert not harness.off_target(before)


@pytest.mark.clause("AxisDriver.stream/position", "AxisDriver.stream/velocity")
def test_a_streamed_radian_is_a_measured_radian(streamed: Harness) -> None:
    start = streamed.image.position_command.copy()
    end = start + streamed.travel(0.3)
    recording = stream_ramp(streamed, start, end, seconds=1.0)
    assert not streamed.off_target(end)
    fastest = 1.5 * np.abs(end - start)  # of the cubic, in 1 s
    assert np.abs(recording.velocity_command).max(0) == pytest.approx(fastest, rel=0.3)


@pytest.mark.clause("AxisDriver.stream/others")
def test_a_stream_moves_its_own_axes_alone(streamed: Harness) -> None:
    start = streamed.image.position_command.copy()
    stream_ramp(streamed, start, start + streamed.travel(0.3), seconds=1.0, axes=[0])
    expected = start.copy()
    expected[0] += streamed.travel(0.3)[0]
    assert not streamed.off_target(expected)


@pytest.mark.clause("FaultInjector.position/shaft")
@pytest.mark.clause("AxisDriver.read/measured")
def test_the_measured_position_is_that_of_the_shaft(
    harness: Harness, injector: FaultInjector
) -> None:
    start = np.array([injector.position(axis) for axis in harness.all])
    assert harness.image.position == pytest.approx(start, abs=SETTLED_RAD)
    distance = harness.travel()
    harness.move(harness.all, harness.image.position_command + distance)
    harness.rest()
    end = np.array([injector.position(axis) for axis in harness.all])
    assert end - start == pytest.approx(distance, abs=2 * SETTLED_RAD)


@pytest.mark.clause("AxisDriver.read/measured", "AxisDriver.read/commands")
@pytest.mark.parametrize("back", [False, True], ids=["forth", "back"])
def test_the_velocity_is_the_slope_of_the_position(harness: Harness, back: bool) -> None:
    if back:
        harness.move_all()
        harness.rest()
    with harness.recording() as recording:
        harness.move(
            harness.all, harness.image.position_command + (-1.0 if back else 1.0) * harness.travel()
        )
        harness.rest()
    problems = slope_problems(harness, recording, "position", "velocity")
    if harness.stepped:  # else commands and values of one sample may belong to different times
        problems += slope_problems(harness, recording, "position_command", "velocity_command")
    judge(harness, recording, problems)


def slope_problems(
    harness: Harness, recording: MotionSamples, positions: str, speed: str
) -> list[str]:
    """Axes whose ``speed`` is not the rate of change of their ``positions``."""
    # Where values are slow they are often coarse, too: a few steps of an encoder show no speed.
    slow = harness.drivers.axes.feedback_period_s
    times_s, slope = recording.slope(getattr(recording, positions), max(SPAN_S, 4.0 * slow))
    lag_s = STEPPED_LAG_S if harness.stepped else LAG_S
    found = []
    for axis in harness.all:
        shown = np.interp(times_s, recording.time_s, getattr(recording, speed)[:, axis])
        profile, error = harness.profile(axis), np.abs(shown - slope[:, axis]).max()
        if error > 0.05 * profile.velocity + lag_s * profile.acceleration:
            found.append(f"axis {axis}: {speed} {error:.3g} rad/s off the slope of {positions}")
    return found


@pytest.mark.clause("AxisDriver.read/commands")
def test_the_commands_in_the_image_are_those_that_were_given(harness: Harness) -> None:
    targets = harness.image.position_command + harness.travel()
    recording = record_move(harness)
    assert recording.position_command[-1] == pytest.approx(targets, abs=SETTLED_RAD)
    for axis in harness.all:
        profile = harness.profile(axis)
        error = np.abs(recording.position_command[:, axis] - recording.position[:, axis])
        assert error.max() <= harness.pose.tolerance[axis] + LAG_S * profile.velocity
        top = np.abs(recording.velocity_command[:, axis]).max()
        assert top <= 1.02 * profile.velocity


@pytest.mark.clause("AxisDriver.read/torque")
def test_torque_is_finite_or_not_known(harness: Harness) -> None:
    harness.move_all(0.3)
    harness.periods(10)
    assert not np.isinf(harness.image.torque).any()
    harness.rest()


@pytest.mark.clause("AxisDriver.jog/starts")
@pytest.mark.needs(Capability.VELOCITY_MODE)
def test_a_positive_velocity_raises_the_position(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    fresh.until(
        lambda: bool((fresh.image.mode == CommandMode.VELOCITY).all()), "all in velocity mode"
    )
    speeds = fresh.speeds(0.3)
    start = fresh.image.position.copy()
    jog(fresh, speeds)
    fresh.pass_time(0.4)
    assert mean_velocity(fresh) == pytest.approx(speeds, rel=0.05, abs=0.01)
    jog(fresh, 0.0 * speeds)
    fresh.rest()
    assert (np.sign(fresh.image.position - start) == np.sign(speeds)).all()


@pytest.mark.clause("AxisDriver.stream/velocity", "AxisDriver.stream/nan")
@pytest.mark.clause("AxisDriver.begin_stream/follows")
@pytest.mark.needs(Capability.VELOCITY_MODE)
def test_a_streamed_velocity_is_a_measured_velocity(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds = fresh.speeds(0.3)
    unknown, began_ns = np.full(fresh.count, np.nan), fresh.clock.now_ns()

    def setpoint(image: ProcessImage) -> None:
        _, share = ramped((fresh.clock.now_ns() - began_ns) * 1e-9, 0.3)
        fresh.stream(unknown, share * speeds)

    claim = fresh.robot.axes.claimed("conformance", fresh.all, CommandMode.VELOCITY)
    with fresh.recording() as recording, claim, fresh.each_period(setpoint):
        fresh.pass_time(0.4)
        assert mean_velocity(fresh) == pytest.approx(speeds, rel=0.05, abs=0.01)
    fresh.rest()
    begin = recording.time_s < 0.1
    kick = np.abs(recording.velocity_command[begin]).max(0) > 0.6 * np.abs(speeds)
    problems = [f"axis {axis} begins with a jump" for axis in np.flatnonzero(kick)]
    judge(fresh, recording, problems)


@pytest.mark.clause("AxisDriver.set_polarity/measured", "AxisDriver.set_polarity/sets")
@pytest.mark.needs(Capability.SCALING)
def test_polarity_turns_the_sign(rescalable: Harness) -> None:
    for axis in rescalable.all:
        rescalable.robot.axes.set_polarity(axis, 1)
    rescalable.periods(5)
    before = rescalable.image.position.copy()
    for axis in rescalable.all:
        rescalable.robot.axes.set_polarity(axis, -1)
    rescalable.periods(5)
    assert rescalable.image.position == pytest.approx(-before, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.set_gear_ratio/counts")
@pytest.mark.needs(Capability.SCALING)
def test_the_gear_ratio_counts_units(rescalable: Harness) -> None:
    moved = []
    for numerator in (2.0**18, 2.0**19):
        for axis in rescalable.all:
            rescalable.robot.axes.set_gear_ratio(axis, numerator, 2.0 * np.pi)
        rescalable.periods(5)
        moved.append(rescalable.image.position.copy())
    assert moved[0] == pytest.approx(2.0 * moved[1], abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.home/no-motion")
@pytest.mark.clause("AxisDriver.home/zero")
@pytest.mark.needs(Capability.HOMING)
def test_homing_makes_the_position_zero_and_moves_nothing(fresh: Harness) -> None:
    fresh.require_rescaling()
    fresh.move_all()
    fresh.rest()
    injector = fresh.fault_injector
    for axis in fresh.all:
        fresh.robot.axes.home(axis)
    fresh.rest()
    assert fresh.image.home_done.all()
    assert fresh.image.position == pytest.approx(np.zeros(fresh.count), abs=SETTLED_RAD)
    assert fresh.image.position_command == pytest.approx(np.zeros(fresh.count), abs=SETTLED_RAD)
    assert injector is None or not fresh.image.velocity.any()


def stream_ramp(
    harness: Harness,
    start: np.ndarray,
    end: np.ndarray,
    seconds: float,
    axes: Sequence[int] | None = None,
) -> MotionSamples:
    """Stream a smooth path from ``start`` to ``end`` for all axes; ``axes`` (all) follow it."""
    began_ns = harness.clock.now_ns()

    def setpoint(image: object) -> None:
        share = min((harness.due_ns - began_ns) * 1e-9 / seconds, 1.0)
        share, slope = 3 * share**2 - 2 * share**3, 6 * (share - share**2) / seconds
        harness.stream(start + share * (end - start), slope * (end - start))

    return record_stream(harness, setpoint, seconds + 0.1, axes)
