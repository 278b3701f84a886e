"""Ramps: each is the requested one; a stop ends any motion at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np
import pytest

from robotd.api import AxisDriver, Capability, FloatArray, Profile
from robotd.api.robots import Outcome
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import jog, judge
from robotd_conformance.checks.recording import MotionSamples
from robotd_conformance.checks.stopwatch import timed

SPAN_S = 0.02  # over which ramps are measured
MORE, LESS = 1.15, 0.85  # share of the asked-for ramp that the steepest part may have
GENTLE = 0.4
JOG_SHARE = 0.5  # of the speed of a move
TIMED_STOPS = 5
LONG_S, LONG_STEPPED_S = 4.0, 20.0  # stepped time costs little

Stop = Callable[[AxisDriver, Sequence[int]], None]
STOPS = [
    pytest.param(lambda driver, axes: driver.stop(axes), id="stop"),
    pytest.param(lambda driver, axes: driver.quick_stop(axes), id="quick_stop"),
]


def uneven(harness: Harness, axis: int, gentle: str) -> Profile:
    """A profile of which one ramp is gentler than the other."""
    even = harness.profile(axis)
    gentler = GENTLE * even.acceleration
    if gentle == "acceleration":
        return Profile(even.velocity, gentler, even.deceleration)
    return Profile(even.velocity, even.acceleration, gentler)


def ramp_problems(
    recording: MotionSamples,
    profiles: Sequence[Profile],
    *,
    rising: bool = True,
    falling: bool = True,
    speeds: FloatArray | None = None,
) -> list[str]:
    """Axes whose steepest ramps are not those of their profiles.

    Args:
        rising, falling: speed up, and slow down, in the recording.
        speeds: (samples, n_axes), none negative; None: of the velocity command.
    """
    chosen = np.abs(recording.velocity_command) if speeds is None else speeds
    _, ramps = recording.slope(chosen, SPAN_S, commanded=speeds is None)
    found = []
    for axis, profile in enumerate(profiles):
        seen = []
        if falling:
            seen.append(("deceleration", -ramps[:, axis].min(), profile.deceleration))
        if rising:
            seen.append(("acceleration", ramps[:, axis].max(), profile.acceleration))
        found += [
            f"axis {axis}: {name} {ramp:.3g} rad/s², asked for {asked:.3g}"
            for name, ramp, asked in seen
            if not LESS * asked <= ramp <= MORE * asked
        ]
    return found


@pytest.mark.clause("AxisDriver.move/profile")
@pytest.mark.parametrize("gentle", ["acceleration", "deceleration"])
@pytest.mark.short_period
def test_a_move_has_the_ramps_of_its_profile(harness: Harness, gentle: str) -> None:
    profiles = [uneven(harness, axis, gentle) for axis in harness.all]
    with harness.recording() as recording:
        harness.move(harness.all, harness.image.position_command + harness.travel(), profiles)
        harness.rest()
    judge(harness, recording, ramp_problems(recording, profiles))


@pytest.mark.clause("AxisDriver.stop/ramp")
@pytest.mark.parametrize("gentle", ["acceleration", "deceleration"])
def test_a_stop_has_the_ramp_of_the_move(harness: Harness, gentle: str) -> None:
    profiles = [uneven(harness, axis, gentle) for axis in harness.all]
    harness.move(harness.all, harness.image.position_command + harness.travel(), profiles)
    harness.pass_time(0.15)
    with harness.recording() as recording:
        harness.periods(3)
        harness.robot.axes.stop(harness.all)
        harness.rest()
    judge(harness, recording, ramp_problems(recording, profiles, rising=False))


@pytest.mark.clause("AxisDriver.jog/zero")
@pytest.mark.clause("AxisDriver.jog/profile", "AxisDriver.stop/ramp", "AxisDriver.stop/starts")
@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.parametrize("gentle", ["acceleration", "deceleration"])
@pytest.mark.short_period
def test_a_velocity_command_has_the_ramps_of_its_profile(fresh: Harness, gentle: str) -> None:
    fresh.set_velocity_mode()
    profiles = [uneven(fresh, axis, gentle) for axis in fresh.all]
    speeds = JOG_SHARE * np.array([profile.velocity for profile in profiles])
    room = fresh.pose.room.T
    middles = [(lower + upper) / 2 if isfinite(upper) else 0.0 for lower, upper in room]
    stops: list[Callable[[], None]] = [
        lambda: fresh.robot.axes.stop(fresh.all),
        lambda: jog(fresh, 0.0 * speeds, profiles),
    ]
    for stop in stops:
        with fresh.recording() as recording:
            # Towards the middle of the range, away from the position limits.
            beyond = fresh.image.position > middles
            jog(fresh, np.where(beyond, -speeds, speeds), profiles)
            fresh.pass_time(0.45)
            stop()
            fresh.rest()
        judge(fresh, recording, ramp_problems(recording, profiles))


@pytest.mark.clause(
    "AxisDriver.stop/stream", "AxisDriver.quick_stop/starts", "AxisDriver.stop/starts"
)
@pytest.mark.parametrize("stop", STOPS)
def test_a_stop_ends_a_trajectory(harness: Harness, joints: list[int], stop: Stop) -> None:
    travel = harness.travel()[joints]
    with harness.following([2.0], [travel]) as execution:
        harness.pass_time(0.8)
        began = harness.image.position.copy()
        stop(harness.drivers.axes, joints)
        harness.until(lambda: execution.done, "the trajectory ends")
    assert execution.outcome is Outcome.FAULT
    harness.rest()
    passed = np.abs(harness.image.position - began)[joints]
    assert (passed < 0.4 * np.abs(travel)).all(), "the trajectory went on"


@pytest.mark.clause("AxisDriver.stop/returns", "AxisDriver.quick_stop/returns")
@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("jogs", [False, True], ids=["move", "jog"])
def test_a_stop_returns_at_once(harness: Harness, stop: Stop, jogs: bool) -> None:
    driver = harness.plugin_axes
    start, durations_s, passed_s = harness.image.position_command.copy(), list[float](), 0.0
    if jogs:
        if not harness.can(Capability.VELOCITY_MODE):
            pytest.skip(f"the {harness.robot.backend.name} backend has no velocity mode")
        harness.set_velocity_mode()
    for count in range(TIMED_STOPS):
        if jogs:
            jog(harness, -harness.speeds(0.5) if count % 2 else harness.speeds(0.5))
        else:
            harness.move(harness.all, start if count % 2 else start + harness.travel())
        harness.pass_time(0.12)
        began_ns = harness.clock.now_ns()
        with timed(durations_s):
            stop(driver, harness.all)
        passed_s += (harness.clock.now_ns() - began_ns) * 1e-9
        harness.rest()
    harness.enable()
    typical_s = sorted(durations_s)[-2]
    assert not (harness.stepped and passed_s), "a stop has waited"
    assert typical_s <= harness.period_s, (
        f"stop takes {1e3 * typical_s:.1f} ms; the control loop calls it, a period has"
        f" {1e3 * harness.period_s:.1f} ms"
    )


@pytest.mark.clause("AxisDriver.stop/rests")
@pytest.mark.parametrize("stop", STOPS)
def test_an_axis_that_is_stopped_neither_returns_nor_goes_on(harness: Harness, stop: Stop) -> None:
    distance = harness.travel()
    harness.move(harness.all, harness.image.position_command + distance)
    harness.pass_time(0.2)
    with harness.recording() as recording:
        stop(harness.drivers.axes, harness.all)
        harness.rest()
        harness.pass_time(1.5)
    passed = (recording.position - recording.position[0]) * np.sign(distance)
    assert (passed.max(0) - passed[-1] <= SETTLED_RAD).all(), (
        "an axis came back after it had stopped"
    )
    later = recording.time_s > recording.time_s[-1] - 1.4
    assert np.ptp(recording.position[later], 0).max() <= SETTLED_RAD, "an axis went on"


@pytest.mark.clause("AxisDriver.move/starts", "AxisDriver.move/target")
def test_a_short_move_is_made(harness: Harness) -> None:
    for sign in (1.0, -1.0):
        targets = harness.image.position_command + sign * np.linspace(0.007, 0.012, harness.count)
        harness.move(harness.all, targets)
        harness.rest()
        assert harness.image.position_command == pytest.approx(targets, abs=SETTLED_RAD)
        assert not harness.off_target(targets)


@pytest.mark.clause("AxisDriver.move/target", "AxisDriver.read/measured")
@pytest.mark.needs(Capability.SIMULATED)
@pytest.mark.free_space
def test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn(harness: Harness) -> None:
    limits = harness.robot.axes.limits
    inner = [
        (limit.lower + 0.025 * room, limit.upper - 0.025 * room)
        if isfinite(room := limit.upper - limit.lower)
        else (limit.lower, limit.upper)
        for limit in limits
    ]
    for far in (0.8, 2.5, 4.0, 9.0, -4.0, 0.0):
        targets = np.array([min(max(far, lower), upper) for lower, upper in inner])
        ramps = [min(0.9 * limit.acceleration, 20.0) for limit in limits]
        profiles = [
            Profile(min(0.9 * limit.velocity, 8.0), ramp, ramp)
            for limit, ramp in zip(limits, ramps, strict=True)
        ]
        harness.move(harness.all, targets, profiles)
        harness.rest()
        assert not harness.off_target(targets)
        assert harness.image.position_command == pytest.approx(targets, abs=SETTLED_RAD)


@pytest.mark.clause("AxisDriver.stop/rests", "AxisDriver.move/target")
def test_a_standing_axis_does_not_drift(harness: Harness) -> None:
    harness.move_all(0.3)
    harness.rest()
    with harness.recording() as recording:
        harness.pass_time(LONG_STEPPED_S if harness.stepped else LONG_S)
    assert np.ptp(recording.position, 0).max() <= SETTLED_RAD
