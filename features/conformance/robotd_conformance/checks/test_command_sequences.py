"""Commands in quick succession, and in every phase of the one before: the last one counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotd.api import Capability, FloatArray, Profile, RobotdError
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import jog, judge, mean_velocity, there_and_back
from robotd_conformance.checks.recording import MotionSamples
from robotd_conformance.checks.test_stop_ramps import sped_up
from robotd_conformance.checks.test_stopping import REACTION_S

# Shares of the travel, and the time until the next command comes.
MOVES = ((1.0, 0.0), (0.2, 0.0), (1.0, 0.12), (0.25, 0.06), (0.9, 0.03), (0.0, 0.15), (0.4, 0.3))
JOGS = ((1.0, 0.0), (0.3, 0.01), (-1.0, 0.15), (0.0, 0.2), (1.0, 0.03), (0.5, 0.3))
NEARER = 0.02  # share of the distance to a target at which an axis cannot stop any more
JOG_SHARE = 0.3
SOFT = 0.2  # share of the ramp with which an axis is slow to stop
SOONER = 0.4  # share of the time of a soft stop that a quick stop may take
LATER_S = 0.05  # until a quick stop follows on a stop
TURNS_S = 0.04  # after a command that turns an axis, when it has not turned yet
BACK_RAD_S = 0.01
SHOWN_S = 0.1  # until a change of the velocity shows, on any fieldbus


@pytest.mark.clause("AxisDriver.move/overrides", "AxisDriver.move/target")
def test_the_last_of_many_moves_counts(harness: Harness) -> None:
    start, travel = harness.image.position_command.copy(), harness.travel()
    for share, wait_s in MOVES:
        harness.move(harness.all, start + share * travel)
        harness.pass_time(wait_s)
    harness.rest()
    assert not harness.off_target(start + MOVES[-1][0] * travel)
    assert harness.image.position_command == pytest.approx(
        start + MOVES[-1][0] * travel, abs=SETTLED_RAD
    )
    assert harness.image.motion_complete.all()


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.jog/changes", "AxisDriver.jog/starts")
def test_the_last_of_many_velocity_commands_counts(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds = fresh.speeds(JOG_SHARE)
    for sign in (1.0, -1.0):
        for share, wait_s in JOGS:
            jog(fresh, sign * share * speeds)
            fresh.pass_time(wait_s)
        expected = sign * JOGS[-1][0] * speeds
        assert fresh.image.velocity_command == pytest.approx(expected, rel=0.02, abs=BACK_RAD_S)
        assert mean_velocity(fresh) == pytest.approx(expected, rel=0.05, abs=BACK_RAD_S)
        jog(fresh, 0.0 * speeds)
        fresh.rest()


@pytest.mark.clause("AxisDriver.move/overrides", "AxisDriver.move/target")
def test_a_target_too_near_to_stop_at_is_reached(harness: Harness) -> None:
    for _, begin, end in there_and_back(harness):
        harness.move(harness.all, end)
        harness.pass_time(0.15)
        targets = harness.image.position_command + NEARER * (end - begin)
        harness.move(harness.all, targets)
        harness.rest()
        assert not harness.off_target(targets)
        assert harness.image.motion_complete.all()


@pytest.mark.clause("AxisDriver/as-commanded")
@pytest.mark.parametrize("command", ["move", "jog"])
def test_a_command_into_a_closed_limit_switch_is_made_or_says_why_not(
    fresh: Harness, command: str
) -> None:
    """Rejected, or made, or ended with the drive's reason; never accepted and nothing else."""
    if command == "jog":
        if not fresh.can(Capability.VELOCITY_MODE):
            pytest.skip("there is no velocity mode")
        fresh.set_velocity_mode()
    driver, image, travel, profile = (
        fresh.drivers.axes,
        fresh.image,
        fresh.travel(),
        fresh.profile(0),
    )
    switch = "positive_limit" if travel[0] > 0.0 else "negative_limit"
    fresh.injector.press_switch(0, switch, True)
    fresh.until(lambda: getattr(image, switch)[0], f"the {switch} is shown")
    start = float(image.position[0])
    try:
        if command == "move":
            driver.move(0, start + float(travel[0]), profile)
        else:
            driver.jog(0, replace(profile, velocity=np.sign(travel[0]) * profile.velocity))
    except RobotdError:
        return
    fresh.wait_until(lambda: abs(image.position[0] - start) > SETTLED_RAD, SHOWN_S + REACTION_S)
    moved = abs(image.position[0] - start) > SETTLED_RAD
    driver.stop([0])
    reason = image.reason[0] or image.fault(0)
    assert moved or reason, f"a {command} was accepted, nothing moves, and no reason is shown"


@pytest.mark.clause("AxisDriver.stop/starts", "AxisDriver.quick_stop/starts")
@pytest.mark.parametrize("quick", [False, True], ids=["stop", "quick_stop"])
def test_a_stop_of_a_move_that_turns_lets_it_not_turn(harness: Harness, quick: bool) -> None:
    start, travel = harness.image.position_command.copy(), harness.travel()
    harness.move(harness.all, start + travel)
    harness.pass_time(0.15)
    harness.move(harness.all, start)
    harness.pass_time(TURNS_S)
    with harness.recording() as recording:
        harness.until(lambda: len(recording) > 0, "there are values")
        stop_all(harness, quick=quick)
        harness.rest()
    judge(harness, recording, turned(recording, travel))


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stop/starts", "AxisDriver.quick_stop/starts")
@pytest.mark.parametrize("quick", [False, True], ids=["stop", "quick_stop"])
def test_a_stop_of_a_velocity_command_ends_it_in_every_phase(fresh: Harness, quick: bool) -> None:
    """While it speeds up, and while it turns."""
    fresh.set_velocity_mode()
    speeds = fresh.speeds(JOG_SHARE)
    for sign in (1.0, -1.0):
        soft_ramps = [SOFT * fresh.profile(axis).acceleration for axis in fresh.all]
        soft = [
            replace(fresh.profile(axis), acceleration=ramp, deceleration=ramp)
            for axis, ramp in enumerate(soft_ramps)
        ]
        jog(fresh, sign * speeds, soft)
        fresh.pass_time(0.1)
        with fresh.recording() as recording:
            fresh.until(lambda: len(recording) > 0, "there are values")
            before = len(recording) - 1
            stop_all(fresh, quick=quick)
            fresh.rest()
        judge(fresh, recording, sped_up(recording, before, soft_ramps))
        jog(fresh, sign * speeds)
        fresh.pass_time(0.2)
        jog(fresh, -sign * speeds, soft)
        fresh.pass_time(TURNS_S)
        with fresh.recording() as recording:
            fresh.until(lambda: len(recording) > 0, "there are values")
            stop_all(fresh, quick=quick)
            fresh.rest()
        judge(fresh, recording, turned(recording, sign * speeds))


@pytest.mark.clause("AxisDriver.quick_stop/starts", "AxisDriver.quick_stop/takes-over")
@pytest.mark.parametrize("phase", ["in motion", "at its end", "at a stop"])
def test_a_quick_stop_of_a_gentle_move_is_quick(harness: Harness, phase: str) -> None:
    start, travel = harness.image.position_command.copy(), harness.travel()
    soft = [soft_stop(profile) for profile in map(harness.profile, harness.all)]
    for targets in (start + travel, start):
        harness.move(harness.all, targets, soft)
        harness.pass_time(0.25 if phase == "at its end" else 0.1)
        if phase == "at a stop":
            harness.drivers.axes.stop(harness.all)
            harness.pass_time(LATER_S)
        check_quick_stop(harness, soft)
        harness.move(harness.all, targets)
        harness.rest()


@pytest.mark.clause("AxisDriver.stop/again")
def test_a_stop_does_not_prolong_a_quick_stop(harness: Harness) -> None:
    soft = [soft_stop(profile) for profile in map(harness.profile, harness.all)]
    harness.move(harness.all, harness.image.position_command + harness.travel(), soft)
    harness.pass_time(0.1)
    check_quick_stop(harness, soft, then_stop=True)


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.quick_stop/starts", "AxisDriver.quick_stop/takes-over")
@pytest.mark.parametrize("phase", ["in motion", "at velocity 0", "at a stop"])
def test_a_quick_stop_of_a_gentle_velocity_command_is_quick(fresh: Harness, phase: str) -> None:
    fresh.set_velocity_mode()
    soft = [soft_stop(profile) for profile in map(fresh.profile, fresh.all)]
    for share in (JOG_SHARE, -0.5 * JOG_SHARE):  # less room on the return
        jog(fresh, fresh.speeds(share), soft)
        fresh.pass_time(0.15)
        if phase == "at velocity 0":
            jog(fresh, 0.0 * fresh.speeds(JOG_SHARE), soft)
        elif phase == "at a stop":
            fresh.drivers.axes.stop(fresh.all)
        check_quick_stop(fresh, soft)


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.jog/changes", "AxisDriver.jog/starts", "AxisDriver.jog/zero")
def test_a_change_of_a_velocity_command_takes_effect_at_once(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    last, before = fresh.count - 1, 0.0
    profile, speed = fresh.profile(last), float(fresh.speeds(JOG_SHARE)[last])
    for share in (0.5, 1.0, 0.4, -0.6, -1.0, 0.0):
        velocity = share * speed
        fresh.drivers.axes.jog(last, replace(profile, velocity=velocity))
        fresh.pass_time(SHOWN_S + fresh.feedback_s)
        shown = float(fresh.image.velocity_command[last])
        least = min(abs(velocity - before), 0.3 * SHOWN_S * profile.acceleration)
        assert abs(shown - before) >= 0.5 * least, (
            f"axis {last}: {shown:.3g} rad/s {SHOWN_S:g} s after a change from {before:.3g} to"
            f" {velocity:.3g} rad/s"
        )
        fresh.pass_time(0.1)
        before = velocity
    fresh.rest()


def soft_stop(profile: Profile) -> Profile:
    """Return a profile whose stop takes long."""
    return replace(profile, deceleration=SOFT * profile.deceleration)


def stop_all(harness: Harness, *, quick: bool) -> None:
    driver = harness.drivers.axes
    (driver.quick_stop if quick else driver.stop)(harness.all)


def turned(recording: MotionSamples, before: FloatArray) -> list[str]:
    """Axes that were stopped while they moved as ``before`` (n_axes,), and went the other way."""
    ahead = recording.velocity_command * np.sign(before)
    back = np.where(ahead[0] > 0.0, -ahead.min(0), 0.0)
    return [
        f"axis {axis}: turned after the stop, with {speed:.3g} rad/s"
        for axis, speed in enumerate(back)
        if speed > BACK_RAD_S
    ]


def check_quick_stop(harness: Harness, soft: list[Profile], *, then_stop: bool = False) -> None:
    """Stop all axes quickly: sooner than by the deceleration of their profiles.

    ``then_stop``: a stop follows at once.
    """
    with harness.recording() as recording:
        harness.until(lambda: len(recording) > 0, "there are values")
        speed = np.abs(harness.image.velocity.copy())
        stop_all(harness, quick=True)
        if then_stop:
            stop_all(harness, quick=False)
        harness.rest()
    problems = []
    for axis, profile in enumerate(soft):
        moving = recording.time_s[np.abs(recording.velocity[:, axis]) > 0.1 * speed[axis]]
        took_s, stop_s = float(moving[-1:].sum()), speed[axis] / profile.deceleration
        if took_s > SOONER * stop_s + REACTION_S:
            problems.append(
                f"axis {axis}: at rest {took_s:.3f} s after the quick stop; a stop takes"
                f" {stop_s:.3f} s"
            )
    judge(harness, recording, problems)
