"""The finest and the gentlest motions, and in both directions the fastest and the steepest."""

from __future__ import annotations

from math import isfinite

import numpy as np
import pytest

from robotd.api import Capability, FloatArray, Profile
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.recorded_motion import jog, judge
from robotd_conformance.checks.test_ramps import ramp_problems
from robotd_conformance.checks.test_small_and_large import steep

FINE_RAD = (5e-5, 1e-4, 2e-4, 5e-4)
EXACT_RAD = 2e-5  # by which the command may miss its target
TIMES = 3  # that each fine move is made, so that errors add up
MADE = 0.1  # share of a fine move that may be missing
FINE_SPEED_RAD_S, FINE_S = 2e-3, 0.4
COARSE_S = 4.0  # in which positions with steps of 1.5 mrad, as of servos, show that speed
GENTLE_SHARE, GENTLE_TRAVEL = 0.04, 0.15
LONG_SHARES = (0.95, 0.6)  # of the limits of velocity and acceleration
CRUISE = 0.25  # part of a long move without ramps
FAST_JOG_SHARE, LONG_MOVE_SHARE = 0.9, 0.85  # of the limits; of the travel that a long move has
SLOWER = 0.07  # what a speed may be less than asked for


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.clause("AxisDriver.move/starts", "AxisDriver.move/target")
@pytest.mark.clause("AxisDriver/as-commanded")
def test_the_finest_moves_are_made(harness: Harness) -> None:
    """A drive has a resolution; a simulation has none that is coarser."""
    sides = np.sign(harness.travel())
    start, driven = harness.image.position_command.copy(), harness.image.position.copy()
    for size in FINE_RAD:
        for side in [1.0] * TIMES + [-1.0] * TIMES + [1.0] * TIMES:
            targets = harness.image.position_command + side * size * sides
            harness.move(harness.all, targets)
            harness.until(
                lambda targets=targets, size=size: bool(  # type: ignore[misc]
                    (np.abs(harness.image.position_command - targets) < MADE * size).all()
                ),
                f"a move of {size:g} rad is made",
                1.0,
            )
    harness.rest()
    travel = TIMES * sum(FINE_RAD) * sides
    assert harness.image.position_command - start == pytest.approx(
        travel, abs=MADE * np.abs(travel).max()
    )
    assert harness.image.position - driven == pytest.approx(travel, abs=0.25 * np.abs(travel).max())


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.clause("AxisDriver.move/target", "AxisDriver/as-commanded")
def test_a_target_is_met_from_both_sides(harness: Harness) -> None:
    """Whatever the distance: not short of the target, and not beyond."""
    home = harness.image.position_command.copy()
    for share in (0.4, 0.1, 0.3, 0.29, 0.2, 0.21, 0.0):
        targets = home + harness.travel(share)
        harness.move(harness.all, targets)
        harness.rest()
        missed = harness.image.position_command - targets
        assert np.abs(missed).max() <= EXACT_RAD, f"targets are missed by {missed} rad"


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.jog/starts", "AxisDriver.jog/changes")
def test_the_slowest_velocity_command_is_executed(fresh: Harness) -> None:
    if not fresh.can(Capability.SIMULATED):
        pytest.skip("a drive has a resolution of its velocity")
    fresh.set_velocity_mode()
    for side in (1.0, -1.0):
        start, speeds = (
            fresh.image.position.copy(),
            side * FINE_SPEED_RAD_S * np.sign(fresh.travel()),
        )
        began_ns = fresh.clock.now_ns()
        jog(fresh, speeds)
        fresh.pass_time(FINE_S if fresh.stepped else COARSE_S)
        assert fresh.image.velocity_command == pytest.approx(speeds, rel=MADE)
        travel = speeds * (fresh.clock.now_ns() - began_ns) * 1e-9
        assert fresh.image.position - start == pytest.approx(
            travel, abs=0.25 * np.abs(travel).max()
        )
        jog(fresh, 0.0 * speeds)
        fresh.rest()


@pytest.mark.clause("AxisDriver.move/profile")
def test_a_gentle_move_is_as_gentle_as_it_was_asked_for(harness: Harness) -> None:
    profiles = [
        Profile(
            profile.velocity,
            GENTLE_SHARE * profile.acceleration,
            2 * GENTLE_SHARE * profile.deceleration,
        )
        for profile in map(harness.profile, harness.all)
    ]
    targets = harness.image.position_command + harness.travel(GENTLE_TRAVEL)
    with harness.recording() as recording:
        harness.move(harness.all, targets, profiles)
        harness.rest()
    judge(harness, recording, ramp_problems(recording, profiles))
    assert not harness.off_target(targets)


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.free_space
@pytest.mark.clause("AxisDriver.move/profile", "AxisDriver.move/target")
@pytest.mark.clause("AxisDriver.device_limits/limits")
@pytest.mark.parametrize("share", LONG_SHARES)
@pytest.mark.clause("AxisDriver/as-commanded")
def test_a_long_move_reaches_its_speed_in_both_directions(harness: Harness, share: float) -> None:
    """A device that clips sooner reports its limits: ``AxisDriver.device_limits``."""
    profiles = [steep(harness, axis, share) for axis in harness.all]
    start = harness.image.position_command.copy()
    end = start + long_travel(harness, profiles)
    problems = []
    for targets in (end, start):
        with harness.recording() as recording:
            harness.move(harness.all, targets, profiles)
            harness.rest()
        problems += ramp_problems(recording, profiles)
        top = np.abs(recording.velocity_command).max(0)
        for axis, profile in enumerate(profiles):
            ramp = profile.acceleration
            asked = min(profile.velocity, float(np.sqrt(abs(end - start)[axis] * ramp)))
            if not (1.0 - SLOWER) * asked <= top[axis] <= 1.02 * asked:
                problems.append(
                    f"axis {axis}: {top[axis]:.3g} rad/s to {targets[axis]:.3g} rad, asked for"
                    f" {asked:.3g}"
                )
        judge(harness, recording, problems)
        assert not harness.off_target(targets)


@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.free_space
@pytest.mark.clause("AxisDriver.jog/starts", "AxisDriver.jog/profile")
@pytest.mark.clause("AxisDriver.device_limits/limits")
@pytest.mark.short_period
def test_a_velocity_command_near_the_limits_is_not_clipped(fresh: Harness) -> None:
    """Checks both directions; a device that clips sooner reports its limits."""
    if not fresh.can(Capability.VELOCITY_MODE):
        pytest.skip("the backend has no velocity mode")
    profiles = [steep(fresh, axis, FAST_JOG_SHARE) for axis in fresh.all]
    travel = long_travel(fresh, profiles)
    passed_s = max(profile.velocity / profile.acceleration for profile in profiles)
    # Of all axes at once: speed up and slow down take a distance of velocity times ``passed_s``.
    speeds = np.sign(travel) * [
        min(
            profile.velocity,
            profile.acceleration * passed_s,
            LONG_MOVE_SHARE * abs(travel[axis]) / passed_s,
        )
        for axis, profile in enumerate(profiles)
    ]
    fresh.set_velocity_mode()
    for sign in (1.0, -1.0):
        with fresh.recording() as recording:
            jog(fresh, sign * speeds, profiles)
            fresh.pass_time(passed_s)
            jog(fresh, 0.0 * speeds, profiles)
            fresh.rest()
        problems = ramp_problems(recording, profiles)
        top = np.abs(recording.velocity_command).max(0)
        problems += [
            f"axis {axis}: {top[axis]:.3g} rad/s, asked for {sign * speeds[axis]:.3g}"
            for axis in fresh.all
            if not (1.0 - SLOWER) * abs(speeds[axis]) <= top[axis] <= 1.02 * abs(speeds[axis])
        ]
        judge(fresh, recording, problems)


def long_travel(harness: Harness, profiles: list[Profile]) -> FloatArray:
    """Return (n_axes,) distances on which ``profiles`` are run, where limits leave that much."""
    travel = np.zeros(harness.count)
    for axis, profile in enumerate(profiles):
        limits, here = harness.robot.axes.limits[axis], harness.image.position_command[axis]
        up, down = limits.upper - here, here - limits.lower
        room = 0.9 * max(up, down)
        wanted = (1.0 + CRUISE) * profile.velocity**2 / profile.acceleration
        travel[axis] = (1.0 if up >= down else -1.0) * (
            min(wanted, room) if isfinite(room) else wanted
        )
    return travel
