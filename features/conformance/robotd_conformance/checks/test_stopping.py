"""Stop and quick stop: in time, within the ramp, and only what was asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from robotd.api import Operation
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

REACTION_S = 0.05  # until a stop begins, on any fieldbus
MORE = 1.3


def stop_moving(
    harness: Harness, stop: Callable[[Sequence[int]], None]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start moves, ``stop`` all axes at full speed: speeds then, times to rest, distances."""
    harness.move_all()
    fast = np.array([0.6 * harness.profile(axis).velocity for axis in harness.all])
    harness.wait_until(lambda: bool((np.abs(harness.image.velocity) > fast).all()))
    with harness.recording() as recording:
        # A device may stop an axis within less than a period: one sample has to be from before.
        harness.until(lambda: len(recording) > 0, "there are values")
        before = len(recording) - 1
        speed = np.abs(harness.image.velocity.copy())
        start = harness.image.position.copy()
        stop(harness.all)
        harness.rest()
    moving = np.abs(recording.velocity) > 0.02 * speed
    assert moving.any(0).all(), "an axis was not moving when it was stopped"
    last = [np.flatnonzero(moving[:, axis])[-1] for axis in harness.all]
    times_s = recording.time_s[last] - recording.time_s[before]
    return speed, times_s, np.abs(harness.image.position - start)


@pytest.mark.clause("AxisDriver.stop/starts", "AxisDriver.response_s/response")
@pytest.mark.short_period
def test_a_stop_takes_the_time_and_distance_of_its_ramp(harness: Harness) -> None:
    speed, time_s, distance = stop_moving(harness, harness.robot.axes.stop)
    for axis in harness.all:
        ramp_s = speed[axis] / harness.profile(axis).deceleration
        assert speed[axis] > 0.5 * harness.profile(axis).velocity, "the axis was not moving"
        reaction_s = REACTION_S + harness.response_s
        assert time_s[axis] <= MORE * ramp_s + reaction_s
        assert distance[axis] <= speed[axis] * (MORE * ramp_s / 2 + reaction_s)


@pytest.mark.clause("AxisDriver.stop/rests")
@pytest.mark.clause("AxisDriver.quick_stop/starts")
def test_a_quick_stop_is_no_slower_than_a_stop(harness: Harness) -> None:
    start = harness.image.position_command.copy()
    _, stop_s, stop_distance = stop_moving(harness, harness.robot.axes.stop)
    harness.move(harness.all, start)
    harness.rest()
    speed, quick_s, quick_distance = stop_moving(harness, harness.robot.axes.quick_stop)
    assert (quick_s <= stop_s + REACTION_S).all()
    assert (quick_distance <= stop_distance + REACTION_S * speed).all()


@pytest.mark.clause("AxisDriver.stop/all-axes", "AxisDriver.stop/starts")
def test_a_stopped_move_is_not_complete(harness: Harness) -> None:
    harness.move_all()
    harness.pass_time(0.2)
    harness.robot.axes.stop(harness.all)
    harness.rest()
    assert not harness.image.motion_complete.any()


@pytest.mark.clause("AxisDriver.stop/all-axes")
def test_a_stop_leaves_other_axes_alone(harness: Harness) -> None:
    targets = harness.move_all()
    harness.pass_time(0.2)
    harness.robot.axes.stop([0])
    harness.rest()
    assert abs(harness.image.position[0] - targets[0]) > 10 * SETTLED_RAD
    assert not harness.off_target(targets, harness.all[1:])


@pytest.mark.clause("AxisDriver.stop/idle", "AxisDriver.quick_stop/idle")
def test_a_stop_of_a_standing_axis_has_no_effect(harness: Harness) -> None:
    harness.move_all(0.1)
    harness.rest()
    start, complete = harness.image.position.copy(), harness.image.motion_complete.copy()
    harness.robot.axes.stop(harness.all)
    harness.robot.axes.quick_stop(harness.all)
    harness.rest()
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD
    assert harness.image.servo_on.all()
    assert (harness.image.motion_complete == complete).all(), "motion_complete has changed"


@pytest.mark.clause("AxisDriver.move/target")
@pytest.mark.clause("AxisDriver.stop/starts")
def test_a_stopped_axis_takes_the_next_move(harness: Harness) -> None:
    targets = harness.image.position_command.copy()
    stop_moving(harness, harness.robot.axes.stop)
    harness.move(harness.all, targets)
    harness.rest()
    assert not harness.off_target(targets)


@pytest.mark.clause("AxisDriver.servo/disables")
def test_a_servo_goes_off_and_on_after_a_quick_stop(harness: Harness) -> None:
    stop_moving(harness, harness.robot.axes.quick_stop)
    harness.disable()
    start = harness.image.position.copy()
    harness.enable()
    harness.pass_time(0.3)
    assert np.abs(harness.image.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("AxisDriver.servo/disables")
def test_a_servo_that_goes_off_ends_the_motion(harness: Harness) -> None:
    targets = harness.image.position_command + harness.travel()
    harness.move([0], targets)
    harness.pass_time(0.15)
    harness.robot.axes.servo(0, False)
    harness.rest([0])
    assert not harness.image.servo_on[0]
    assert harness.image.operation[0] == Operation.IDLE
