"""Sizes of moves: the smallest and slowest are made, and the steepest are not clipped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotd.api import Capability, Profile
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.recorded_motion import jog, judge
from robotd_conformance.checks.test_ramps import ramp_problems

STEP_RAD, STEPS = 1e-3, 10
SLOW_SHARE, SLOW_TRAVEL = 0.05, 0.1
ROUGH = 0.25  # tolerance of a ramp within a few samples
SHARES = (0.9, 0.6)  # of the limits
FAST_RAD_S, STEEP_RAD_S2 = 8.0, 40.0  # where an axis has no limits


@pytest.mark.clause("AxisDriver.move/overrides")
@pytest.mark.clause("AxisDriver.move/starts", "AxisDriver.move/target")
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["forth", "back"])
@pytest.mark.clause("AxisDriver/as-commanded")
def test_small_moves_add_up(harness: Harness, sign: float) -> None:
    start, travel = harness.image.position_command.copy(), sign * np.sign(harness.travel())
    for _ in range(STEPS):
        targets = harness.image.position_command + STEP_RAD * travel
        harness.move(harness.all, targets)
        harness.until(
            lambda targets=targets: bool(  # type: ignore[misc]
                (np.abs(harness.image.position_command - targets) < 0.1 * STEP_RAD).all()
            ),
            f"a move of {STEP_RAD:g} rad is made",
            2.0,
        )
    harness.rest()
    end = start + STEPS * STEP_RAD * travel
    assert harness.image.position_command == pytest.approx(end, abs=0.1 * STEPS * STEP_RAD)
    assert not harness.off_target(end)


@pytest.mark.clause("AxisDriver.read/commands")
@pytest.mark.clause("AxisDriver.move/profile", "AxisDriver.move/target")
def test_a_slow_move_is_as_slow_as_it_was_asked_for(harness: Harness) -> None:
    profiles = [harness.profile(axis, SLOW_SHARE) for axis in harness.all]
    start = harness.image.position_command.copy()
    with harness.recording() as recording:
        harness.move(harness.all, start + SLOW_TRAVEL * harness.travel(), profiles)
        harness.rest()
    _, speeds = recording.slope(recording.position_command, 0.1, commanded=True)
    top = np.abs(speeds).max(0)
    problems = [
        f"axis {axis}: {top[axis]:.3g} rad/s, commanded {profile.velocity:.3g}"
        for axis, profile in enumerate(profiles)
        if not 0.8 * min(profile.velocity, top.max()) <= top[axis] <= 1.15 * profile.velocity
    ]
    judge(harness, recording, problems)


@pytest.mark.clause("AxisDriver.move/profile")
@pytest.mark.short_period
def test_each_move_has_its_own_profile(harness: Harness) -> None:
    """One that follows on another, in the other direction, and of each axis."""
    even = [harness.profile(axis) for axis in harness.all]
    start, travel = harness.image.position_command.copy(), harness.travel()
    problems = []
    for step, (speed, ramp) in enumerate(((1.0, 1.0), (0.5, 0.4), (0.7, 0.8), (0.3, 0.5))):
        profiles = [
            Profile(
                (speed if axis % 2 else 0.8 * speed) * profile.velocity,
                ramp * profile.acceleration,
                0.9 * ramp * profile.deceleration,
            )
            for axis, profile in enumerate(even)
        ]
        with harness.recording() as recording:
            harness.move(harness.all, start if step % 2 else start + travel, profiles)
            harness.rest()
        found = ramp_problems(recording, profiles)
        top = np.abs(recording.velocity_command).max(0)
        for axis, profile in enumerate(profiles):
            ramps = 2.0 * profile.acceleration * profile.deceleration
            peak = np.sqrt(
                abs(travel[axis]) * ramps / (profile.acceleration + profile.deceleration)
            )
            asked = min(profile.velocity, float(peak))
            if abs(top[axis] - asked) > 0.1 * asked:
                found.append(f"axis {axis}: {top[axis]:.3g} rad/s, asked for {asked:.3g}")
        problems += [f"move {step + 1}, {problem}" for problem in found]
        judge(harness, recording, problems)


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.clause("AxisDriver.move/profile", "AxisDriver.device_limits/limits")
@pytest.mark.parametrize("share", SHARES)
def test_a_move_near_the_limits_is_not_clipped(harness: Harness, share: float) -> None:
    """A device that clips sooner reports its limits: ``AxisDriver.device_limits``."""
    profiles = [steep(harness, axis, share) for axis in harness.all]
    start, travel = harness.image.position_command.copy(), harness.travel()
    shortest_s = [
        2.0 * np.sqrt(abs(travel[i]) / profile.acceleration) for i, profile in enumerate(profiles)
    ]
    problems = []
    for targets in (start + travel, start):
        with harness.recording() as recording:
            harness.move(harness.all, targets, profiles)
            harness.rest()
        moving = np.abs(recording.velocity_command) > 0.02 * np.abs(recording.velocity_command).max(
            0
        )
        for axis in harness.all:
            took_s = np.ptp(recording.time_s[moving[:, axis]])
            cruise = profiles[axis].velocity
            peak = np.sqrt(abs(travel[axis]) * profiles[axis].acceleration)
            least_s = shortest_s[axis]
            if peak > cruise:
                least_s = abs(travel[axis]) / cruise + cruise / profiles[axis].acceleration
            if took_s > (1 + ROUGH) * least_s + 4 * harness.feedback_s:
                problems.append(f"axis {axis}: {took_s:.3f} s for a move of {least_s:.3f} s")
        judge(harness, recording, problems)


def steep(harness: Harness, axis: int, share: float) -> Profile:
    """A profile at ``share`` of the limits of an axis."""
    limits = harness.robot.axes.limits[axis]
    ramp = min(share * limits.acceleration, STEEP_RAD_S2)
    return Profile(min(share * limits.velocity, FAST_RAD_S), ramp, ramp)


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.jog/profile")
@pytest.mark.short_period
def test_each_velocity_command_has_its_own_ramps(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds = fresh.speeds(0.4)
    for ramp, sign in ((1.0, 1.0), (0.4, -1.0), (0.8, 1.0)):
        profiles = [
            replace(
                profile,
                acceleration=ramp * profile.acceleration,
                deceleration=ramp * profile.deceleration,
            )
            for profile in map(fresh.profile, fresh.all)
        ]
        with fresh.recording() as recording:
            jog(fresh, sign * speeds, profiles)
            fresh.pass_time(0.35)
            jog(fresh, 0.0 * speeds, profiles)
            fresh.rest()
        judge(fresh, recording, ramp_problems(recording, profiles))
