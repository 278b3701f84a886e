"""A command that follows on another has its own ramps, whatever the one before had."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import pytest

from robotd.api import Capability, CommandMode, Profile, RobotdError
from robotd_conformance.checks.different_ramps import (
    AFTER_S,
    FIRST_SPEED,
    FIRST_TRAVEL,
    different_ramps,
    ramp_s,
    turn_problems,
)
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.recorded_motion import jog, judge, there_and_back
from robotd_conformance.checks.test_ramps import ramp_problems

JOG_SHARE = 0.3
# Shares of the speed of a velocity command, one after the other.
AHEAD_S = 0.2  # at the highest speed: the way back does not go beyond the start
CHANGES = (0.5, 1.0, 0.5, -0.5, -1.0, -0.5, 0.5, 0.0)


@pytest.mark.clause("AxisDriver.move/overrides", "AxisDriver.move/new-profile")
@pytest.mark.parametrize("where", ["farther", "same", "back"])
@pytest.mark.short_period
def test_a_move_that_overrides_another_has_its_own_ramps(harness: Harness, where: str) -> None:
    for command, begin, end in there_and_back(harness):
        first = different_ramps(harness, FIRST_SPEED, command)
        second = different_ramps(harness, 1.0, command + 1)
        aim = begin + FIRST_TRAVEL * (end - begin)
        targets = {"farther": end, "same": aim, "back": begin}[where]
        harness.move(harness.all, aim, first)
        harness.pass_time(ramp_s(first))
        with harness.recording() as recording:
            harness.periods(2)
            harness.move(harness.all, targets, second)
            harness.rest()
        if where == "back":
            problems = turn_problems(recording, second, end - begin, stops=True)
        else:
            problems = ramp_problems(recording, second, rising=where == "farther")
        problems += harness.off_target(targets)
        judge(harness, recording, [f"override {command + 1}, {problem}" for problem in problems])


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.jog/changes", "AxisDriver.jog/new-profile", "AxisDriver.jog/zero")
@pytest.mark.clause("AxisDriver.jog/profile")
@pytest.mark.short_period
def test_each_change_of_a_velocity_command_has_its_own_ramps(fresh: Harness) -> None:
    fresh.set_velocity_mode()
    speeds, before = fresh.speeds(JOG_SHARE), 0.0
    for command, share in enumerate(CHANGES):
        profiles = different_ramps(fresh, JOG_SHARE, command)
        with fresh.recording() as recording:
            fresh.periods(2)
            jog(fresh, share * speeds, profiles)
            fresh.pass_time(change_s(profiles, before, share))
        if share == max(CHANGES):
            fresh.pass_time(AHEAD_S)
        if before * share < 0.0:
            problems = turn_problems(recording, profiles, before * speeds, stops=False)
        else:
            rises = abs(share) > abs(before)
            problems = ramp_problems(recording, profiles, rising=rises, falling=not rises)
        what = f"from {before:.0%} to {share:.0%} of its velocity"
        judge(fresh, recording, [f"{problem}, {what}" for problem in problems])
        before = share
    fresh.rest()


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.move/profile", "AxisDriver.jog/profile")
@pytest.mark.clause("AxisDriver.set_command_mode/changes")
@pytest.mark.short_period
def test_moves_and_velocity_commands_in_turn_have_their_own_ramps(fresh: Harness) -> None:
    start = fresh.image.position_command.copy()
    for command in range(4):
        profiles = different_ramps(fresh, JOG_SHARE, command)
        mode = CommandMode.VELOCITY if command % 2 else CommandMode.POSITION
        for axis in fresh.all:
            fresh.robot.axes.set_command_mode(axis, mode)
        with fresh.recording() as recording:
            if mode is CommandMode.VELOCITY:
                jog(fresh, -fresh.speeds(JOG_SHARE), profiles)
                fresh.pass_time(ramp_s(profiles))
                fresh.robot.axes.stop(fresh.all)
            else:
                fresh.move(fresh.all, start + fresh.travel(0.8), profiles)
            fresh.rest()
        problems = ramp_problems(recording, profiles)
        judge(fresh, recording, [f"command {command + 1}, {problem}" for problem in problems])


@pytest.mark.clause("AxisDriver.move/while-stopping")
@pytest.mark.parametrize("quick", [False, True], ids=["stop", "quick_stop"])
@pytest.mark.clause("AxisDriver/as-commanded")
def test_a_move_during_a_stop_is_rejected_or_made(harness: Harness, quick: bool) -> None:
    driver, start = harness.drivers.axes, harness.image.position_command.copy()
    there = start + harness.travel()
    gentle = [
        replace(profile, deceleration=0.25 * profile.deceleration)
        for profile in map(harness.profile, harness.all)
    ]
    for targets, begin in ((there, start), (start, there)):
        harness.move(harness.all, targets, gentle)
        harness.pass_time(0.15)
        (driver.quick_stop if quick else driver.stop)(harness.all)
        harness.pass_time(0.02)
        taken = []
        for axis in harness.all:
            with suppress(RobotdError):
                driver.move(axis, float(begin[axis]), harness.profile(axis))
                taken.append(axis)
        harness.rest()
        lost = harness.off_target(begin, taken)
        assert not lost, "axes took a move while they stopped, and have not made it"
        harness.move(harness.all, targets)
        harness.rest()


def change_s(profiles: list[Profile], before: float, share: float) -> float:
    """Return the time of the longest change between shares of the velocities of ``profiles``."""
    turns = before * share < 0.0
    falls = abs(before) if turns else max(0.0, abs(before) - abs(share))
    rises = abs(share) if turns else max(0.0, abs(share) - abs(before))
    longest_s = max(
        profile.velocity * (falls / profile.deceleration + rises / profile.acceleration)
        for profile in profiles
    )
    return longest_s + AFTER_S
