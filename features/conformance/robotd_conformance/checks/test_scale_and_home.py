"""Home, polarity and gear ratio together: each leaves alone what the others have set."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from robotd.api import Capability, CommandMode, FloatArray, OperationError, RobotdError
from robotd.api.robots import Jog
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import judge, mean_velocity
from robotd_conformance.checks.test_scaling import COUNTS, TURN
from robotd_conformance.checks.test_units import slope_problems, stream_ramp

OFF_ZERO_RAD = 0.03  # from where on a position shows its scale and its sign
FASTER = 1.25  # a scale near the axis' own: its motion stays what the robot allows
DISTANCE_RAD = 0.1
ALARMS = 0x2310, 0x7305  # a current, and an encoder: after that a drive may start anew
SMALL_RAD = 0.006  # a displacement that a home within the tolerance of a limit switch would leave
SPEED = 0.8, 1.2  # share of the commanded speed that a move reaches, at least and at most


def scaled_positions(harness: Harness) -> FloatArray:
    """Give every axis ``COUNTS`` per ``TURN`` and polarity 1; return the positions (n_axes,)."""
    for axis in harness.all:
        harness.robot.axes.set_gear_ratio(axis, COUNTS, TURN)
        harness.robot.axes.set_polarity(axis, 1)
    harness.periods(5)
    positions = harness.image.position.copy()
    near = np.flatnonzero(np.abs(positions) < OFF_ZERO_RAD)
    if near.size:
        pytest.skip(f"axis {near[0]} is too near to zero to show its scale")
    return positions


def assert_positions(harness: Harness, expected: FloatArray, what: str) -> None:
    """Fail with the first axis that is not at ``expected`` (n_axes,)."""
    harness.periods(5)
    position = harness.image.position
    wrong = np.flatnonzero(~(np.abs(position - expected) <= SETTLED_RAD))
    assert not wrong.size, (
        f"{what}: axis {wrong[0]} is at {position[wrong[0]]:.4f}, not at {expected[wrong[0]]:.4f}"
    )


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_gear_ratio/polarity", "AxisDriver.set_polarity/ratio")
@pytest.mark.clause("AxisDriver.set_gear_ratio/counts", "AxisDriver.set_polarity/sets")
def test_polarity_and_gear_ratio_leave_each_other_alone(rescalable: Harness) -> None:
    """Each axis has a polarity and a ratio of its own, in both orders."""
    axes, plain = rescalable.robot.axes, scaled_positions(rescalable)
    expected = plain.copy()
    for axis in rescalable.all:
        factor = 1.5 + 0.25 * axis
        axes.set_polarity(axis, -1)
        for divisor in (1.0, factor, factor, 1.0, factor):
            axes.set_gear_ratio(axis, divisor * COUNTS, TURN)
            expected[axis] = -plain[axis] / divisor
            assert_positions(rescalable, expected, f"gear ratio of axis {axis}, polarity -1")
        for polarity in (-1, 1, 1, -1):
            axes.set_polarity(axis, polarity)
            expected[axis] = polarity * plain[axis] / factor
            assert_positions(rescalable, expected, f"polarity {polarity} of axis {axis}")


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_gear_ratio/counts", "AxisDriver.read/measured")
@pytest.mark.clause("AxisDriver.read/commands", "AxisDriver.move/profile")
def test_all_values_have_the_new_scale(rescalable: Harness) -> None:
    """Measured and commanded, in both directions, by ratios near the axis' own."""
    own = rescalable.image.position.copy()
    if np.abs(own).min() < OFF_ZERO_RAD:
        pytest.skip("an axis is too near to zero to show its scale")
    ratio = COUNTS / TURN * np.abs(scaled_positions(rescalable) / own)  # counts per unit
    for axis, factor in ((0, FASTER), (rescalable.count - 1, 1.0 / FASTER)):
        rescalable.robot.axes.set_gear_ratio(axis, factor * float(ratio[axis]) * TURN, TURN)
        rescalable.periods(5)
        limits, here = rescalable.robot.axes.limits[axis], rescalable.image.position[axis]
        if not limits.lower + DISTANCE_RAD < here < limits.upper - DISTANCE_RAD:
            pytest.skip(f"axis {axis} would leave its limits")
        rescalable.robot.axes.servo(axis, True)
        targets, profile = rescalable.image.position_command.copy(), rescalable.profile(axis)
        # Half of what the ramps allow on this distance: the move cruises.
        speed = min(profile.velocity, 0.5 * float(np.sqrt(DISTANCE_RAD * profile.acceleration)))
        profiles = [replace(profile, velocity=speed)] * rescalable.count
        for distance in (DISTANCE_RAD, -DISTANCE_RAD):
            targets[axis] += distance
            with rescalable.recording() as recording:
                rescalable.move([axis], targets, profiles)
                rescalable.rest([axis])
            at = rescalable.image.position[axis]
            assert abs(at - targets[axis]) <= SETTLED_RAD, f"axis {axis} went to {at:.4f}"
            problems = slope_problems(rescalable, recording, "position", "velocity")
            top = float(np.abs(recording.velocity[:, axis]).max())
            if not SPEED[0] * speed <= top <= SPEED[1] * speed:
                problems.append(f"axis {axis} moves at {top:.3f} rad/s, commanded {speed:.3f}")
            if rescalable.stepped:  # see test_units
                problems += slope_problems(
                    rescalable, recording, "position_command", "velocity_command"
                )
            judge(rescalable, recording, problems)
        rescalable.robot.axes.servo(axis, False)
        rescalable.rest()


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/sets", "AxisDriver.set_gear_ratio/counts")
@pytest.mark.clause("AxisDriver.jog/starts", "AxisDriver.stream/position")
def test_every_kind_of_command_has_the_new_scale(rescalable: Harness) -> None:
    """A stream of positions, and a velocity command in both directions, of the turned last axis."""
    own, last = rescalable.image.position.copy(), rescalable.count - 1
    if np.abs(own).min() < OFF_ZERO_RAD:
        pytest.skip("an axis is too near to zero to show its scale")
    axes, limits = rescalable.robot.axes, rescalable.robot.axes.limits[last]
    ratio = COUNTS / TURN * abs(float(scaled_positions(rescalable)[last] / own[last]))
    axes.set_gear_ratio(last, FASTER * ratio * TURN, TURN)
    axes.set_polarity(last, -1)
    rescalable.periods(5)
    here = rescalable.image.position[last]
    if not limits.lower + DISTANCE_RAD < here < limits.upper - DISTANCE_RAD:
        pytest.skip("the last axis would leave its limits")
    rescalable.enable()
    begin = rescalable.image.position_command.copy()
    if not axes.trajectories_on_device:
        for distance in (0.6 * DISTANCE_RAD, -0.6 * DISTANCE_RAD):
            end = begin.copy()
            end[last] += distance
            stream_ramp(rescalable, begin, end, seconds=0.5)
            at = rescalable.image.position[last]
            assert abs(at - end[last]) <= SETTLED_RAD, (
                f"a stream to {end[last]:.4f} ends at {at:.4f}"
            )
            begin = end
    if not rescalable.can(Capability.VELOCITY_MODE):
        return
    axes.set_command_mode(last, CommandMode.VELOCITY)
    for velocity in (0.1, -0.1):
        profile = replace(rescalable.profile(last), velocity=velocity)
        axes.jog([Jog(last, profile)])
        rescalable.pass_time(0.2)
        shown = mean_velocity(rescalable)[last]
        axes.jog([Jog(last, replace(profile, velocity=0.0))])
        rescalable.rest([last])
        assert shown == pytest.approx(velocity, abs=0.02), f"{velocity} rad/s are {shown:.3f}"


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/sets", "AxisDriver.set_gear_ratio/counts")
def test_a_scale_is_changed_beside_axes_in_motion(fresh: Harness) -> None:
    fresh.require_rescaling()
    last = fresh.count - 1
    if last == 0 or len(fresh.servo_group(last)) > 1:
        pytest.skip("no axis can be off beside one that moves")
    fresh.robot.axes.servo(last, False)
    targets = fresh.image.position_command + fresh.travel()
    others = fresh.all[:last]
    with fresh.recording() as recording:
        fresh.move(others, targets)
        fresh.pass_time(0.1)
        fresh.drivers.axes.set_polarity(last, -1)
        fresh.drivers.axes.set_gear_ratio(last, COUNTS, TURN)
        fresh.rest(others)
    away = np.abs(fresh.image.position - targets)[others]
    problems = [f"axis {away.argmax()} is {away.max():.4f} rad from its target"]
    judge(fresh, recording, problems if away.max() > SETTLED_RAD else [])
    assert fresh.image.motion_complete[others].all()
    assert fresh.image.servo_on[others].all()


@pytest.mark.needs(Capability.HOMING)
@pytest.mark.clause("AxisDriver.home/servo-off", "AxisDriver.home/zero")
@pytest.mark.clause("AxisDriver.home/no-motion")
def test_homing_with_the_servo_off_is_done_or_rejected(fresh: Harness) -> None:
    """Each axis, the last one first, after it was moved by hand where that is possible."""
    fresh.require_rescaling()
    fresh.move_all()
    fresh.rest()
    fresh.disable()
    if fresh.fault_injector is not None:
        for axis, delta in enumerate(fresh.travel(0.2)):
            with suppress(RobotdError):  # not every simulation can be turned without power
                fresh.fault_injector.move_by_hand(axis, float(delta))
    fresh.rest()
    expected = fresh.image.position.copy()
    for axis in reversed(fresh.all):
        try:
            fresh.drivers.axes.home(axis, 10.0)
        except OperationError:
            pass
        else:
            expected[axis] = 0.0
            fresh.periods(2)
            assert fresh.image.home_done[axis], f"homing of axis {axis} is said to be done"
        assert_positions(fresh, expected, f"homing of axis {axis} with its servo off")
        assert not fresh.image.servo_on.any(), "homing has switched a servo on"


@pytest.mark.needs(Capability.HOMING)
@pytest.mark.clause("AxisDriver.home/zero", "AxisDriver.home/command")
def test_the_command_is_zero_after_homing_too(fresh: Harness) -> None:
    """Homes one axis after the other; then a move counts from there."""
    fresh.require_rescaling()
    fresh.move_all(0.6)
    fresh.rest()
    for axis in reversed(fresh.all):
        others = fresh.image.position_command.copy()
        fresh.drivers.axes.home(axis, 10.0)
        fresh.periods(2)
        others[axis] = 0.0
        wrong = np.abs(fresh.image.position_command - others)
        assert wrong.max() <= SETTLED_RAD, (
            f"homing of axis {axis}: the command of axis {wrong.argmax()} is"
            f" {fresh.image.position_command[wrong.argmax()]:.4f}"
        )


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/measured", "AxisDriver.set_gear_ratio/counts")
@pytest.mark.clause("AxisDriver.set_polarity/ratio", "AxisDriver.set_gear_ratio/polarity")
def test_a_scale_turns_about_the_home_position(fresh: Harness) -> None:
    """After homing at another place a change of scale leaves zero where it is."""
    fresh.require_rescaling()
    if not fresh.can(Capability.HOMING):
        pytest.skip("the axes have no home")
    axes, last = fresh.robot.axes, fresh.count - 1
    limits = axes.limits[last]
    if not limits.lower < 0.0 < limits.upper:
        pytest.skip("the home position would be outside the limits of the last axis")
    fresh.move_all()
    fresh.rest()
    fresh.drivers.axes.home(last, 10.0)
    fresh.periods(5)
    targets = fresh.image.position_command.copy()
    targets[last] -= fresh.travel(0.3)[last]
    if not limits.lower < targets[last] < limits.upper:
        targets[last] = -targets[last]
    fresh.move([last], targets)
    fresh.rest()
    fresh.disable()
    expected = fresh.image.position.copy()
    for polarity in (-1, 1):
        axes.set_polarity(last, polarity)
        fresh.periods(5)
        now = fresh.image.position[last]
        assert abs(abs(now) - abs(targets[last])) <= SETTLED_RAD, (
            f"polarity {polarity}: the last axis is at {now:.4f}, it was at {expected[last]:.4f}"
        )
    axes.set_gear_ratio(last, COUNTS, TURN)
    fresh.periods(5)
    one = fresh.image.position[last]
    axes.set_gear_ratio(last, 2.0 * COUNTS, TURN)
    fresh.periods(5)
    now = fresh.image.position[last]
    assert abs(now - one / 2.0) <= SETTLED_RAD, f"{now:.4f} with twice the ratio, {one:.4f} before"


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.home/no-motion", "AxisDriver.home/scale")
def test_homing_leaves_the_scale_alone(rescalable: Harness) -> None:
    """Setting afterwards what is in force already changes no position."""
    if not rescalable.can(Capability.HOMING):
        pytest.skip("the axes have no home")
    axes, last = rescalable.robot.axes, rescalable.count - 1
    limits = axes.limits[last]
    if not limits.lower < -DISTANCE_RAD < DISTANCE_RAD < limits.upper:
        pytest.skip("the home position would be outside the limits of the last axis")
    axes.set_polarity(last, -1)
    axes.set_gear_ratio(last, 1.5 * COUNTS, TURN)
    rescalable.periods(5)
    axes.servo(last, True)
    rescalable.drivers.axes.home(last, 10.0)
    rescalable.periods(5)
    targets = rescalable.image.position_command.copy()
    targets[last] += DISTANCE_RAD / 2.0
    rescalable.move([last], targets)
    rescalable.rest([last])
    axes.servo(last, False)
    rescalable.rest()
    expected = rescalable.image.position.copy()
    axes.set_polarity(last, -1)
    assert_positions(rescalable, expected, "the polarity as before homing")
    axes.set_gear_ratio(last, 1.5 * COUNTS, TURN)
    assert_positions(rescalable, expected, "the gear ratio as before homing")


@pytest.mark.needs(Capability.HOMING)
@pytest.mark.clause("AxisDriver.home/zero", "AxisDriver.home/scale")
@pytest.mark.parametrize("polarity", [1, -1])
def test_homing_makes_a_small_offset_zero_too(fresh: Harness, polarity: int) -> None:
    """The last axis is homed, goes a little further, and is homed again; to both sides."""
    fresh.require_rescaling()
    last = fresh.count - 1
    limits, driver = fresh.robot.axes.limits[last], fresh.drivers.axes
    if not limits.lower < -SMALL_RAD < SMALL_RAD < limits.upper:
        pytest.skip("the home position would be outside the limits of the last axis")
    if polarity < 0:
        if not fresh.can(Capability.SCALING):
            pytest.skip("the polarity cannot be set")
        fresh.robot.axes.servo(last, False)
        fresh.rest()
        driver.set_polarity(last, polarity)
        fresh.periods(5)
        fresh.robot.axes.servo(last, True)
    for distance in (0.0, SMALL_RAD, -SMALL_RAD):
        targets = fresh.image.position_command.copy()
        if distance:
            targets[last] = distance
            fresh.move([last], targets)
            fresh.rest()
        targets[last] = 0.0
        driver.home(last, 10.0)
        assert_positions(fresh, targets, f"homing {1e3 * distance:g} mrad from the home before")


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/sets", "AxisDriver.set_gear_ratio/counts")
@pytest.mark.clause("AxisDriver.clear_alarm/clears")
def test_a_scale_outlives_an_alarm_and_a_servo(rescalable: Harness) -> None:
    """Tripped, cleared, switched on and off: each time the position stays what it was."""
    axes, last = rescalable.robot.axes, rescalable.count - 1
    injector = rescalable.injector
    for axis in rescalable.all:
        axes.set_gear_ratio(axis, 1.5 * COUNTS, TURN)
        axes.set_polarity(axis, -1)
    rescalable.periods(5)
    expected = rescalable.image.position.copy()
    for axis in dict.fromkeys((0, last)):
        for code in ALARMS:
            injector.trip(axis, code)
            rescalable.until(lambda: bool(rescalable.image.amp_alarm.any()), "an alarm", 1.0)
            assert_positions(rescalable, expected, f"alarm {code:#x} of axis {axis}")
            axes.clear_alarm(axis)
            assert_positions(rescalable, expected, f"clearing alarm {code:#x} of axis {axis}")
        if axes.limits[axis].lower < expected[axis] < axes.limits[axis].upper:
            axes.servo(axis, True)
            assert_positions(rescalable, expected, f"servo on of axis {axis}")
            axes.servo(axis, False)
            assert_positions(rescalable, expected, f"servo off of axis {axis}")
