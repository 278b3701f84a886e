"""Velocity commands and position limits."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.device.harness import Harness

from robotd.device.axes import Jog, Move
from robotd.device.soft_limits import SoftLimitGuard
from robotd.device.state import CommandMode, Operation
from robotd.errors import InvalidArgument
from robotd.motion.limits import AxisLimits, room_to_stop
from robotd.motion.profile import Profile

LIMITS = AxisLimits(-1.0, 2.0, 3.0, 10.0)


@pytest.fixture
def jogged(harness: Harness) -> Harness:
    """All axes in velocity mode and in the middle."""
    harness.driver.image.mode[:] = CommandMode.VELOCITY
    harness.driver.image.position[:] = 0.0
    harness.refresh()
    return harness


def place(harness: Harness, axis: int, position: float, velocity: float) -> None:
    harness.driver.image.position[axis] = position
    harness.driver.image.velocity_command[axis] = velocity
    harness.driver.image.operation[axis] = Operation.VELOCITY
    harness.refresh()


def stopped(harness: Harness) -> list[object]:
    SoftLimitGuard(harness.axes).look(harness.image)
    return [call[1] for call in harness.driver.calls if call[0] == "stop"]


@pytest.mark.parametrize(
    ("position", "velocity", "stops"),
    [
        (1.7, 1.0, False),  # 0.1 rad to brake in, 0.3 there
        (1.897, 1.0, True),
        (1.999, -1.0, False),  # away from the limit
        (-0.897, -1.0, True),
        (5.0, -1.0, False),  # beyond, on the way back
        (5.0, 0.1, True),
        (math.nan, 1.0, True),  # not known
    ],
)
def test_a_velocity_command_ends_where_just_enough_room_is_left(
    jogged: Harness, position: float, velocity: float, stops: bool
) -> None:
    jogged.axes.jog([Jog(0, Profile(0.1, 5.0, 5.0))])
    place(jogged, 0, position, velocity)
    assert stopped(jogged) == ([[0]] if stops else [])


@pytest.mark.parametrize(("command", "stops"), [(1.8, False), (1.897, True), (math.nan, False)])
def test_an_axis_that_is_behind_its_command_is_stopped_by_that(
    jogged: Harness, command: float, stops: bool
) -> None:
    jogged.axes.jog([Jog(0, Profile(0.1, 5.0, 5.0))])
    jogged.driver.image.position_command[0] = command
    place(jogged, 0, 1.7, 1.0)
    assert stopped(jogged) == ([[0]] if stops else [])


def test_a_device_may_measure_no_velocity(jogged: Harness) -> None:
    jogged.axes.jog([Jog(axis, Profile(0.1, 5.0, 5.0)) for axis in range(3)])
    jogged.driver.image.velocity[:] = math.nan
    place(jogged, 0, 1.897, 1.0)
    place(jogged, 1, 1.7, 1.0)
    place(jogged, 2, math.nan, 1.0)  # no limits
    assert stopped(jogged) == [[0]]


def test_a_jog_from_an_unknown_position_is_rejected(jogged: Harness) -> None:
    jogged.driver.image.position[:] = math.nan
    jogged.refresh()
    with pytest.raises(
        InvalidArgument, match=r"^joint1: from nan rad, .* cannot be stopped before"
    ):
        jogged.axes.jog([Jog(0, Profile(0.1, 5.0, 5.0))])
    jogged.axes.jog([Jog(2, Profile(0.1, 5.0, 5.0))])


def test_other_motion_and_unlimited_axes_are_left_alone(jogged: Harness) -> None:
    place(jogged, 0, 1.999, 3.0)
    jogged.driver.image.operation[0] = Operation.STOPPING
    place(jogged, 2, 1e6, 100.0)
    assert stopped(jogged) == []


@pytest.mark.parametrize(("position", "velocity"), [(1.95, 1.0), (-0.95, -1.0), (2.0, 0.1)])
def test_a_command_that_could_not_be_stopped_in_time_is_rejected(
    jogged: Harness, position: float, velocity: float
) -> None:
    jogged.driver.image.position[0] = position
    jogged.refresh()
    with pytest.raises(InvalidArgument, match=r"^joint1: from .* cannot be stopped before"):
        jogged.axes.jog([Jog(0, Profile(velocity, 5.0, 5.0))])
    jogged.axes.jog([Jog(0, Profile(-velocity, 5.0, 5.0))])


@given(st.floats(-1.0, 2.0), st.floats(-3.0, 3.0), st.floats(0.1, 10.0))
def test_braking_uses_up_exactly_what_is_not_left(
    position: float, velocity: float, deceleration: float
) -> None:
    room = room_to_stop(LIMITS, position, velocity, deceleration)
    time_s = abs(velocity) / deceleration
    rest = position + velocity * time_s / 2.0
    if velocity:
        expected = LIMITS.upper - rest if velocity > 0.0 else rest - LIMITS.lower
        assert room == pytest.approx(expected, abs=1e-9)
    else:
        assert room == math.inf


GENTLE = Profile(0.1, 5.0, 1.0)


@pytest.mark.parametrize(("position", "kept"), [(1.0, False), (1.6, True)])
def test_a_gentler_command_near_a_limit_keeps_the_deceleration_in_force(
    jogged: Harness, position: float, kept: bool
) -> None:
    """At 1 rad/s it would need 0.5 rad."""
    jogged.axes.jog([Jog(0, Profile(1.0, 5.0, 5.0))])
    place(jogged, 0, position, 1.0)
    jogged.axes.jog([Jog(0, GENTLE)])
    profile: Any = jogged.driver.calls[-1][2]
    assert profile.deceleration == (5.0 if kept else 1.0)
    assert profile.velocity == GENTLE.velocity


def test_so_does_a_move_back(harness: Harness) -> None:
    harness.axes.move([Move(0, 1.9, Profile(1.0, 5.0, 5.0))])
    place(harness, 0, 1.6, 1.0)
    harness.driver.image.operation[0] = Operation.POSITION
    harness.refresh()
    harness.axes.move([Move(0, 0.0, GENTLE)])
    profile: Any = harness.driver.calls[-1][3]
    assert profile.deceleration == 5.0
