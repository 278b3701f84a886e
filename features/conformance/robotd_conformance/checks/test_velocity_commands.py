"""Velocity commands and streams: changed without a jump, in both directions, axis by axis."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from robotd.api import Capability, CommandMode, FloatArray, Operation, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, STANDSTILL_RAD_S, Harness
from robotd_conformance.checks.recorded_motion import (
    jog,
    judge,
    mean_velocity,
    ramped,
    steep_ramps,
)
from robotd_conformance.checks.recording import MotionSamples
from robotd_conformance.checks.test_profiles import MORE, SPAN_S

pytestmark = pytest.mark.needs(Capability.VELOCITY_MODE)

SLOW_SHARE = 0.02
REACTION_S = 0.05
SLIGHT = (1.0, 1.02, 1.0, 0.98)  # of a speed, one after the other
LASTS_S = 4.0  # longer than a command that is taken for a heartbeat
HARD = 1.5  # what a ramp may be above the limit of its axis


@pytest.mark.clause("AxisDriver.jog/starts", "AxisDriver.jog/changes")
def test_a_velocity_command_is_changed_without_a_jump(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds, seen = fresh.speeds(0.3), []
    with fresh.recording() as recording:
        for share in (1.0, 0.4, -1.0, -0.3):
            jog(fresh, share * speeds)
            fresh.pass_time(0.3)
            seen.append((share, mean_velocity(fresh)))
        jog(fresh, 0.0 * speeds)
        fresh.rest()
    problems = [
        f"axis {axis}: {measured[axis]:.3g} rad/s, commanded {share * speeds[axis]:.3g}"
        for share, measured in seen
        for axis in fresh.all
        if abs(measured[axis] - share * speeds[axis]) > 0.05 * abs(speeds[axis]) + 0.01
    ]
    judge(fresh, recording, problems + steep_ramps(fresh, recording, SPAN_S, MORE))


@pytest.mark.clause("AxisDriver.jog/changes", "AxisDriver.jog/starts")
def test_a_slight_change_of_a_velocity_command_is_made(fresh: Harness) -> None:
    """A controller that regulates with velocity commands changes them by little each time."""
    if not fresh.stepped:
        pytest.skip("slight changes are judged in simulated time")
    fresh.set_velocity_mode()
    for sign in (1.0, -1.0):
        speeds, seen = sign * fresh.speeds(0.3), list[FloatArray]()
        for number, share in enumerate(SLIGHT):
            jog(fresh, share * speeds)
            fresh.pass_time(0.1 if number else 0.3)
            seen.append(mean_velocity(fresh) / speeds)
        jog(fresh, 0.0 * speeds)
        fresh.rest()
        changes, asked = np.diff(seen, axis=0), np.diff(SLIGHT)
        problems = [
            f"axis {axis}: its speed changes by {changes[step, axis]:+.2%}, asked for {share:+.2%}"
            for step, share in enumerate(asked)
            for axis in fresh.all
            if abs(changes[step, axis] - share) > 0.5 * abs(share)
        ]
        assert not problems, "; ".join(problems)


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.set_command_mode/changes")
@pytest.mark.clause("AxisDriver.jog/starts", "AxisDriver.jog/zero")
def test_a_velocity_command_moves_its_axis_alone(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    start, speeds, last = fresh.image.position.copy(), fresh.speeds(0.3), fresh.count - 1
    driver = fresh.drivers.axes
    for velocity in (speeds[last], 0.0):
        driver.jog(last, replace(fresh.profile(last), velocity=float(velocity)))
        fresh.pass_time(0.2)
        if velocity:
            assert fresh.image.operation[last] == Operation.VELOCITY
            assert mean_velocity(fresh)[last] == pytest.approx(velocity, rel=0.05, abs=0.01)
    fresh.rest()
    assert (fresh.image.operation == Operation.IDLE).all(), "not idle at velocity 0"
    moved = np.abs(fresh.image.position - start)
    assert moved[last] > 5 * SETTLED_RAD
    assert moved[:-1].max(initial=0.0) <= SETTLED_RAD, "another axis moved, too"


@pytest.mark.clause("AxisDriver.jog/starts")
def test_a_slow_velocity_command_is_executed(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds, start = fresh.speeds(SLOW_SHARE), fresh.image.position.copy()
    began_ns = fresh.clock.now_ns()
    jog(fresh, speeds)
    fresh.pass_time(0.8)
    expected = speeds * (fresh.clock.now_ns() - began_ns) * 1e-9
    moved = fresh.image.position - start
    jog(fresh, 0.0 * speeds)
    fresh.rest()
    assert moved == pytest.approx(expected, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.end_stream/velocity", "AxisDriver.stream/velocity")
def test_a_velocity_stream_that_ends_slows_to_rest(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds, unknown = fresh.speeds(0.3), np.full(fresh.count, np.nan)
    for sign in (1.0, -1.0):
        began_ns = fresh.clock.now_ns()

        def send(image: ProcessImage, sign: float = sign, began_ns: int = began_ns) -> None:
            _, share = ramped((fresh.due_ns - began_ns) * 1e-9, 0.2)
            fresh.stream(unknown, sign * share * speeds)

        streaming = ExitStack()
        claim = fresh.robot.axes.claimed("conformance", fresh.all, CommandMode.VELOCITY)
        with streaming:
            streaming.enter_context(claim)
            streaming.enter_context(fresh.each_period(send))
            fresh.pass_time(0.4)
            with fresh.recording() as recording:
                fresh.periods(3)
                streaming.close()
                fresh.rest()
        judge(fresh, recording, end_problems(fresh, recording, np.abs(speeds)))


@pytest.mark.clause(
    "AxisDriver.set_command_mode/nothing-moves", "AxisDriver.set_command_mode/changes"
)
def test_changing_the_mode_moves_nothing(fresh: Harness) -> None:
    start = fresh.image.position.copy()
    with fresh.recording() as recording:
        for mode in (CommandMode.VELOCITY, CommandMode.POSITION) * 2:
            for axis in fresh.all:
                fresh.drivers.axes.set_command_mode(axis, mode)
            fresh.periods(2)
            assert (fresh.image.mode == mode).all(), "the mode is not that of the command"
            fresh.pass_time(0.15)
    assert np.abs(recording.position - start).max() <= SETTLED_RAD
    assert np.abs(recording.velocity_command).max() <= STANDSTILL_RAD_S
    assert fresh.image.servo_on.all()


def end_problems(harness: Harness, recording: MotionSamples, speeds: FloatArray) -> list[str]:
    """Axes that come to rest late, or harder than their limits allow."""
    span_s = 2 * harness.period_s if harness.stepped else SPAN_S
    _, ramps = recording.slope(recording.velocity_command, span_s, commanded=True)
    found = []
    for axis in harness.all:
        moving = np.abs(recording.velocity[:, axis]) > 0.05 * speeds[axis]
        rest_s = recording.time_s[moving][-1:].sum() - 3 * harness.feedback_s
        longest_s = 1.3 * speeds[axis] / harness.profile(axis).deceleration + REACTION_S
        longest_s += harness.response_s
        hardest, limit = np.abs(ramps[:, axis]).max(), harness.robot.axes.limits[axis].acceleration
        if rest_s > longest_s:
            found.append(f"axis {axis}: at rest after {rest_s:.2f} s, expected {longest_s:.2f} s")
        if hardest > HARD * limit:
            found.append(f"axis {axis}: slowed by {hardest:.3g} rad/s², the limit is {limit:.3g}")
    return found


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.clause("AxisDriver.jog/starts")
def test_a_velocity_command_does_not_expire(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds = fresh.travel(0.5) / LASTS_S
    for axis in fresh.all:
        fresh.drivers.axes.jog(axis, replace(fresh.profile(axis), velocity=float(speeds[axis])))
    fresh.pass_time(LASTS_S)
    assert (fresh.image.operation == Operation.VELOCITY).all(), "a velocity command has ended"
    assert fresh.image.velocity_command == pytest.approx(speeds, rel=0.05)
    fresh.drivers.axes.stop(fresh.all)
    fresh.rest()
