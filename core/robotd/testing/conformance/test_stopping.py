"""Stop and quick stop: in time, within the ramp, and only what was asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robotd.device.state import Operation
from robotd.testing.conformance.rig import SETTLED_RAD, Rig

REACTION_S = 0.05  # until a stop begins, on any fieldbus
MORE = 1.3


def stop_moving(
    rig: Rig, stop: Callable[[Sequence[int]], None]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start moves, ``stop`` all axes at full speed: speeds then, times to rest, distances."""
    rig.move(rig.all, rig.image.position_command + rig.travel())
    rig.let(0.25)
    with rig.recording() as recording:
        # A device may stop an axis within less than a period: one sample has to be from before.
        rig.until(lambda: len(recording) > 0, "there are values")
        before = len(recording) - 1
        speed = np.abs(rig.image.velocity.copy())
        start = rig.image.position.copy()
        stop(rig.all)
        rig.rest()
    moving = np.abs(recording.velocity) > 0.02 * speed
    assert moving.any(0).all(), "an axis was not moving when it was stopped"
    last = [np.flatnonzero(moving[:, axis])[-1] for axis in rig.all]
    times_s = recording.time_s[last] - recording.time_s[before]
    return speed, times_s, np.abs(rig.image.position - start)


def test_a_stop_takes_the_time_and_way_of_its_ramp(rig: Rig) -> None:
    speed, time_s, distance = stop_moving(rig, rig.robot.axes.stop)
    for axis in rig.all:
        ramp_s = speed[axis] / rig.profile(axis).deceleration
        assert speed[axis] > 0.5 * rig.profile(axis).velocity, "the axis was not moving"
        assert time_s[axis] <= MORE * ramp_s + REACTION_S
        assert distance[axis] <= speed[axis] * (MORE * ramp_s / 2 + REACTION_S)


def test_a_quick_stop_is_no_slower_than_a_stop(rig: Rig) -> None:
    _, stop_s, stop_way = stop_moving(rig, rig.robot.axes.stop)
    rig.move(rig.all, rig.image.position_command - rig.travel(0.5))
    rig.rest()
    speed, quick_s, quick_way = stop_moving(rig, rig.robot.axes.quick_stop)
    assert (quick_s <= stop_s + REACTION_S).all()
    assert (quick_way <= stop_way + REACTION_S * speed).all()


def test_a_stopped_move_is_not_complete(rig: Rig) -> None:
    rig.move(rig.all, rig.image.position_command + rig.travel())
    rig.let(0.2)
    rig.robot.axes.stop(rig.all)
    rig.rest()
    assert not rig.image.motion_complete.any()


def test_a_stop_leaves_other_axes_alone(rig: Rig) -> None:
    targets = rig.image.position_command + rig.travel()
    rig.move(rig.all, targets)
    rig.let(0.2)
    rig.robot.axes.stop([0])
    rig.rest()
    assert abs(rig.image.position[0] - targets[0]) > 10 * SETTLED_RAD
    assert np.abs(rig.image.position[1:] - targets[1:]).max(initial=0.0) <= SETTLED_RAD


def test_a_stop_of_a_standing_axis_has_no_effect(rig: Rig) -> None:
    start = rig.image.position.copy()
    rig.robot.axes.stop(rig.all)
    rig.robot.axes.quick_stop(rig.all)
    rig.rest()
    assert np.abs(rig.image.position - start).max() <= SETTLED_RAD
    assert rig.image.servo_on.all()


def test_a_stopped_axis_takes_the_next_move(rig: Rig) -> None:
    stop_moving(rig, rig.robot.axes.stop)
    targets = rig.image.position_command - rig.travel(0.3)
    rig.move(rig.all, targets)
    rig.rest()
    assert np.abs(rig.image.position - targets).max() <= SETTLED_RAD


def test_a_servo_that_goes_off_ends_the_motion(rig: Rig) -> None:
    targets = rig.image.position_command + rig.travel()
    rig.move([0], targets)
    rig.let(0.15)
    rig.robot.axes.servo(0, False)
    rig.rest([0])
    assert not rig.image.servo_on[0]
    assert rig.image.operation[0] == Operation.IDLE
