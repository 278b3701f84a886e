"""Stops of axes whose commands differ: in their ramps, in their kind, and in whether there is one.

One call names them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from robotd.api import Capability, CommandMode, Operation, ProcessImage
from robotd_conformance.checks.different_ramps import (
    FIRST_SPEED,
    FIRST_TRAVEL,
    different_ramps,
    ramp_s,
)
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import jog, judge, ramped, there_and_back
from robotd_conformance.checks.recording import MotionSamples
from robotd_conformance.checks.test_ramps import LESS, ramp_problems
from robotd_conformance.checks.test_stopping import MORE, REACTION_S
from robotd_conformance.checks.test_stops_of_some_axes import EARLY_S, STOPS, Stop

AFTER_SPEED = 0.25  # share of the speed of a move after a stop
JOG_SHARE = 0.3
RISING_S = 0.06  # of a move that still speeds up
HARD, HARDEST_RAD_S2 = 0.95, 10.0  # share of the limit with which an axis slows down
NOTICED_RAD_S = 0.03
STREAM_STOP_S = 0.2  # of a slow stream, with a ramp of the driver's own


@pytest.fixture(params=STOPS)
def stop(request: pytest.FixtureRequest) -> Stop:
    """``stop`` or ``quick_stop`` of a driver, called by its name."""
    name = request.param.__name__
    return lambda driver, axes: getattr(driver, name)(axes)


@pytest.mark.clause("AxisDriver.stop/ramp", "AxisDriver.move/new-profile", "AxisDriver.stop/rests")
@pytest.mark.short_period
def test_a_stop_has_the_ramp_of_the_last_move(harness: Harness) -> None:
    """Checks each axis, also after an overridden move and after a quick stop."""
    for command, begin, end in there_and_back(harness):
        first = different_ramps(harness, FIRST_SPEED, command)
        second = different_ramps(harness, 1.0, command + 1)
        harness.move(harness.all, begin + FIRST_TRAVEL * (end - begin), first)
        harness.pass_time(ramp_s(first))
        harness.move(harness.all, end, second)
        harness.pass_time(RISING_S)
        with harness.recording() as recording:
            harness.periods(2)
            harness.drivers.axes.stop(harness.all[:: -1 if command else 1])
            harness.rest()
        problems = ramp_problems(recording, second, rising=False)
        if harness.stepped:  # else commands and values of one sample may belong to different times
            problems += jumps(recording, harness.feedback_s - harness.period_s)
        judge(harness, recording, [f"stop {command + 1}, {problem}" for problem in problems])
        harness.move(harness.all, begin)
        harness.pass_time(EARLY_S)
        harness.drivers.axes.quick_stop(harness.all)
        harness.rest()


@pytest.mark.clause("AxisDriver.move/profile", "AxisDriver.stop/rests")
@pytest.mark.short_period
def test_a_move_after_a_stop_has_its_own_profile(harness: Harness, stop: Stop) -> None:
    """The move has its own velocity and ramps, not those of what preceded."""
    start, distance = harness.image.position_command.copy(), harness.travel()
    harness.move(harness.all, start + distance, different_ramps(harness, 1.0, 0))
    harness.pass_time(EARLY_S)
    stop(harness.drivers.axes, harness.all)
    harness.rest()
    profiles = different_ramps(harness, AFTER_SPEED, 1)
    with harness.recording() as recording:
        harness.move(harness.all, start + distance, profiles)
        harness.rest()
    problems = ramp_problems(recording, profiles)
    top = np.abs(recording.velocity_command).max(0)
    problems += [
        f"axis {axis}: {top[axis]:.3g} rad/s, asked for {profile.velocity:.3g}"
        for axis, profile in enumerate(profiles)
        if not 0.9 * profile.velocity <= top[axis] <= 1.05 * profile.velocity
    ]
    judge(harness, recording, problems)


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stop/ramp", "AxisDriver.jog/new-profile")
@pytest.mark.short_period
def test_a_stop_has_the_ramp_of_the_last_velocity_command(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds = fresh.speeds(JOG_SHARE)
    for command, sign in enumerate((1.0, -1.0)):
        slow, profiles = (different_ramps(fresh, JOG_SHARE, command + shift) for shift in (1, 2))
        for share, ramps in ((0.5, slow), (1.0, profiles)):
            jog(fresh, sign * share * speeds, ramps)
            fresh.pass_time(ramp_s(ramps))
        with fresh.recording() as recording:
            fresh.periods(2)
            fresh.drivers.axes.stop(fresh.all[:: -1 if command else 1])
            fresh.rest()
        problems = ramp_problems(recording, profiles, rising=False)
        judge(fresh, recording, [f"stop {command + 1}, {problem}" for problem in problems])


@pytest.mark.clause("AxisDriver.stop/starts", "AxisDriver.quick_stop/starts")
@pytest.mark.short_period
def test_an_axis_that_is_stopped_speeds_up_no_more(harness: Harness, stop: Stop) -> None:
    harness.move_all()
    harness.pass_time(RISING_S)
    with harness.recording() as recording:
        harness.until(lambda: len(recording) > 0, "there are values")
        before = len(recording) - 1
        stop(harness.drivers.axes, harness.all)
        harness.rest()
    ramps = [harness.profile(axis).acceleration for axis in harness.all]
    judge(harness, recording, sped_up(recording, before, ramps))


@pytest.mark.clause("AxisDriver.stop/all-axes", "AxisDriver.stop/idle")
@pytest.mark.clause("AxisDriver.quick_stop/starts", "AxisDriver.quick_stop/idle")
def test_a_stop_of_moving_and_idle_axes_stops_all_that_move(harness: Harness, stop: Stop) -> None:
    """The idle one is first, in the middle and last in the list."""
    if harness.count < 2:
        pytest.skip(f"the robot {harness.robot.descriptor.name} has one axis")
    start = harness.image.position_command.copy()
    idle_axes = sorted({0, harness.count // 2, harness.count - 1})
    for turn, idle in enumerate(idle_axes):
        targets = start if turn % 2 else start + harness.travel()
        moving = [axis for axis in harness.all if axis != idle]
        harness.move(moving, targets)
        harness.pass_time(EARLY_S)
        stop(harness.drivers.axes, harness.all)
        harness.rest()
        left = np.abs(harness.image.position - targets)[moving]
        gone_on = [
            axis for axis, distance in zip(moving, left, strict=True) if distance < 5 * SETTLED_RAD
        ]
        assert not gone_on, f"a stop of {harness.all} with axis {idle} idle did not stop {gone_on}"
        harness.move(harness.all, targets)
        harness.rest()


@pytest.mark.clause("AxisDriver.stop/idle", "AxisDriver.quick_stop/idle")
@pytest.mark.clause("AxisDriver.stop/all-axes", "AxisDriver.quick_stop/starts")
def test_a_stop_reaches_axes_beside_one_without_power(harness: Harness, stop: Stop) -> None:
    start = harness.image.position_command.copy()
    for off in sorted({0, harness.count - 1}):
        group = harness.servo_group(off)
        moving = [axis for axis in harness.all if axis not in group]
        if not moving:
            pytest.skip("all axes share one servo switch")
        harness.robot.axes.servo(off, False)
        targets = start + harness.travel()
        harness.move(moving, targets)
        harness.pass_time(EARLY_S)
        stop(harness.drivers.axes, harness.all)
        harness.rest(moving)
        left = np.abs(harness.image.position - targets)[moving]
        assert (left > 5 * SETTLED_RAD).all(), f"a stop with axis {off} off did not stop all"
        harness.enable()
        harness.move(harness.all, start)
        harness.rest()


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stop/starts", "AxisDriver.stop/all-axes")
@pytest.mark.clause("AxisDriver.quick_stop/starts", "AxisDriver.stop/stream")
@pytest.mark.parametrize("first", [0, 1, 2])
def test_one_stop_ends_motions_of_every_kind(fresh: Harness, stop: Stop, first: int) -> None:
    """A move, a velocity command and a velocity stream, by different axes at the same time."""
    kinds = {axis: (axis + first) % 3 for axis in fresh.all}
    moving, jogging, streaming = ([a for a in fresh.all if kinds[a] == kind] for kind in range(3))
    for axis in jogging + streaming:
        fresh.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    speeds, began_ns = fresh.speeds(0.2), fresh.clock.now_ns()
    unknown = np.full(fresh.count, np.nan)

    def send(image: ProcessImage) -> None:
        share = ramped((fresh.due_ns - began_ns) * 1e-9, 0.1)[1]
        fresh.stream(unknown, share * speeds)

    if moving:
        fresh.move(moving, fresh.image.position_command + fresh.travel())
    for axis in jogging:
        profile = replace(fresh.profile(axis), velocity=float(speeds[axis]))
        fresh.drivers.axes.jog(axis, profile)
    with ExitStack() as streams:
        if streaming:
            claim = fresh.robot.axes.claimed("conformance", streaming, CommandMode.VELOCITY)
            streams.enter_context(claim)
            streams.enter_context(fresh.each_period(send))
        fresh.pass_time(0.15)
        assert (fresh.image.operation != Operation.IDLE).all(), "not every axis moves"
        stop(fresh.drivers.axes, fresh.all)
        ramps_s = [
            profile.velocity / profile.deceleration for profile in map(fresh.profile, fresh.all)
        ]
        fresh.pass_time(
            MORE * max(STREAM_STOP_S, *ramps_s)
            + REACTION_S
            + fresh.response_s
            + 2 * fresh.feedback_s
        )
        on = [axis for axis in fresh.all if abs(fresh.image.velocity[axis]) > NOTICED_RAD_S]
        assert not on, f"a stop of {fresh.all} did not stop {on}"
    fresh.rest()


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.clause("AxisDriver.quick_stop/starts")
@pytest.mark.short_period
def test_a_quick_stop_is_no_gentler_than_the_hardest_stop(harness: Harness) -> None:
    limits = [min(limit.acceleration, HARDEST_RAD_S2) for limit in harness.robot.axes.limits]
    hard = [
        replace(harness.profile(axis), deceleration=HARD * limit)
        for axis, limit in enumerate(limits)
    ]
    harness.move(harness.all, harness.image.position_command + harness.travel(), hard)
    harness.pass_time(EARLY_S)
    with harness.recording() as recording:
        harness.until(lambda: len(recording) > 0, "there are values")
        harness.drivers.axes.quick_stop(harness.all)
        harness.rest()
    speeds, span_s = np.abs(recording.velocity_command), 2.0 * harness.feedback_s
    _, ramps = recording.slope(speeds, span_s, commanded=True)
    problems = [
        f"axis {axis}: a quick stop with {-ramps[:, axis].min():.3g} rad/s², a stop with"
        f" {profile.deceleration:.3g}"
        for axis, profile in enumerate(hard)
        if -ramps[:, axis].min() < LESS * profile.deceleration
    ]
    judge(harness, recording, problems)


def sped_up(recording: MotionSamples, before: int, ramps: Sequence[float]) -> list[str]:
    """Axes that went on to speed up with ``ramps[axis]``, after a stop at sample ``before``."""
    speed = np.abs(recording.velocity_command)
    rise = speed[before:].max(0) - speed[before]
    most = 0.5 * REACTION_S * np.array(ramps) + NOTICED_RAD_S
    return [
        f"axis {axis}: sped up by {rise[axis]:.3g} rad/s after the stop, at most {most[axis]:.3g}"
        for axis in np.flatnonzero(rise > most)
    ]


def jumps(recording: MotionSamples, held_s: float) -> list[str]:
    """Axes whose position command jumps: it is not where its velocity command leads.

    ``held_s``: a command may be that much newer than the time of the values beside it.
    """
    velocity, steps_s = recording.velocity_command, np.diff(recording.time_s)[:, None]
    led = 0.5 * (velocity[1:] + velocity[:-1]) * steps_s
    jump = np.abs(np.diff(recording.position_command, axis=0) - led).max(0)
    allowed = SETTLED_RAD + held_s * np.abs(velocity).max(0)
    return [
        f"axis {axis}: its position command jumps by {jump[axis]:.4f}"
        for axis in np.flatnonzero(jump > allowed)
    ]
