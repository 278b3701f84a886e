"""Moves keep to the profile that they were given, and to nothing more."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import Operation
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import judge, record_move, steep_ramps

SPAN_S = 0.02  # over which ramps are measured
MORE = 1.1  # what a measured value may be above its limit


@pytest.mark.clause("AxisDriver.read/fills")
@pytest.mark.clause("AxisDriver.move/profile")
@pytest.mark.parametrize("share", [1.0, 0.4])
def test_a_move_keeps_to_its_velocity(harness: Harness, share: float) -> None:
    travel, recording = np.abs(harness.travel()), record_move(harness, share)
    problems = []
    for axis, top in enumerate(np.abs(recording.velocity).max(0)):
        profile = harness.profile(axis, share)
        # On a short travel a gentle ramp leaves no time for the whole speed.
        reached = min(profile.velocity, float(np.sqrt(travel[axis] * profile.acceleration)))
        if not 0.8 * reached <= top <= MORE * profile.velocity:
            problems.append(f"axis {axis}: {top:.3g} rad/s, commanded {profile.velocity:.3g}")
    judge(harness, recording, problems)


@pytest.mark.clause("AxisDriver.move/profile")
def test_a_move_keeps_to_its_ramps(harness: Harness) -> None:
    recording = record_move(harness)
    judge(harness, recording, steep_ramps(harness, recording, SPAN_S, MORE))


@pytest.mark.clause("AxisDriver.move/profile")
@pytest.mark.short_period
def test_a_second_is_a_second(harness: Harness) -> None:
    distance, recording = harness.travel(), record_move(harness, 0.3)
    for axis in harness.all:
        profile = harness.profile(axis, 0.3)
        shortest_s = (
            abs(distance[axis]) / profile.velocity + profile.velocity / profile.acceleration
        )
        moving = recording.time_s[np.abs(recording.velocity[:, axis]) > 0.02 * profile.velocity]
        took_s = moving[-1] - moving[0]
        # Ramps may be rounded off, which takes longer; nothing may be faster than its profile.
        assert 0.93 * shortest_s <= took_s <= 1.5 * shortest_s + 0.1


@pytest.mark.clause("AxisDriver.move/target")
def test_a_move_ends_at_its_target_without_overshoot(harness: Harness) -> None:
    start, distance = harness.image.position.copy(), harness.travel()
    recording = record_move(harness)
    for axis in harness.all:
        passed = (recording.position[:, axis] - start[axis]) * np.sign(distance[axis])
        assert passed.max() <= abs(distance[axis]) + harness.pose.tolerance[axis]
        assert passed.min() >= -SETTLED_RAD


@pytest.mark.clause("AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.read/complete")
def test_a_move_shows_what_it_does(harness: Harness) -> None:
    harness.move_all()
    harness.until(
        lambda: bool((harness.image.operation == Operation.POSITION).all()), "all axes move"
    )
    assert not harness.image.motion_complete.any()
    harness.rest()
    assert harness.image.motion_complete.all()


@pytest.mark.clause("AxisDriver.move/overrides")
def test_a_new_target_is_taken_without_a_jump(harness: Harness) -> None:
    # From inside the travel, so that it turns back within the range of an axis that starts at its
    # end.
    start, distance = harness.image.position_command.copy(), harness.travel()
    harness.move(harness.all, start + 0.3 * distance)
    harness.rest()
    with harness.recording() as recording:
        harness.move(harness.all, start + distance)
        harness.pass_time(0.2)
        harness.move(harness.all, start + 0.1 * distance)
        harness.rest()
    assert not harness.off_target(start + 0.1 * distance)
    judge(harness, recording, steep_ramps(harness, recording, SPAN_S, MORE))


@pytest.mark.clause("AxisDriver.move/overrides", "AxisDriver.move/profile")
@pytest.mark.parametrize("farther", [True, False], ids=["farther", "back"])
def test_a_new_target_has_its_own_profile(harness: Harness, farther: bool) -> None:
    start, travel = harness.image.position_command.copy(), harness.travel()
    slow = [harness.profile(axis, 0.4) for axis in harness.all]
    targets = start + (travel if farther else 0.1 * travel)
    harness.move(harness.all, start + 0.2 * travel)
    harness.rest()
    with harness.recording() as recording:
        harness.move(harness.all, start + 0.7 * travel)
        harness.pass_time(0.1)
        harness.move(harness.all, targets, slow)
        harness.pass_time(0.1)
        harness.rest()
    assert not harness.off_target(targets)
    problems = steep_ramps(harness, recording, SPAN_S, MORE)
    late = recording.time_s > recording.time_s[0] + 0.4
    for axis, profile in enumerate(slow):
        top = np.abs(recording.velocity_command[late, axis]).max()
        if top > MORE * profile.velocity + SETTLED_RAD:
            problems.append(f"axis {axis}: {top:.3g} rad/s, commanded {profile.velocity:.3g}")
    judge(harness, recording, problems)


@pytest.mark.clause("AxisDriver.move/starts")
def test_a_move_to_where_it_stands_ends(harness: Harness) -> None:
    start = harness.image.position.copy()
    harness.move(harness.all, harness.image.position_command)
    harness.rest()
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD
