"""Commands to one axis: rejected by name, value and limit."""

import math
from typing import Any

import numpy as np
import pytest

from robotd.errors import InvalidArgument, OperationError
from robotd.motion import AxisLimits, JointLimits, MotionState, check_jog, check_move
from robotd.motion.profile import Profile

JOINT = AxisLimits(-3.14, 2.86, 3.14, 12.57)


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ((3.0, 1.0, 1.0, 1.0), "target 3 rad exceeds 2.86 rad"),
        ((-3.2, 1.0, 1.0, 1.0), "target -3.2 rad is below -3.14 rad"),
        ((math.nan, 1.0, 1.0, 1.0), "target is nan, must be a finite number"),
        ((0.0, 4.0, 1.0, 1.0), "velocity 4 rad/s exceeds 3.14 rad/s"),
        ((0.0, 0.0, 1.0, 1.0), "velocity is 0, must be positive"),
        ((0.0, -1.0, 1.0, 1.0), "velocity is -1, must be positive"),
        ((0.0, math.inf, 1.0, 1.0), "velocity is inf, must be a finite number"),
        ((0.0, 1.0, 0.0, 1.0), "acceleration is 0, must be positive"),
        ((0.0, 1.0, 1.0, -2.0), "deceleration is -2, must be positive"),
        ((0.0, 5e-324, 1.0, 1.0), "velocity is 4.94066e-324, must be at least 1e-09"),
        ((0.0, 1.0, 1.0, 1e-12), "deceleration is 1e-12, must be at least 1e-09"),
        ((0.0, 1.0, 13.0, 1.0), "acceleration 13 rad/s² exceeds 12.57 rad/s²"),
        ((0.0, 1.0, 1.0, 13.0), "deceleration 13 rad/s² exceeds 12.57 rad/s²"),
    ],
)
def test_a_move_beyond_a_limit_is_rejected(command: tuple[float, ...], text: str) -> None:
    with pytest.raises(InvalidArgument) as rejected:
        check_move(JOINT, command[0], Profile(*command[1:]))
    assert str(rejected.value) == text
    assert isinstance(rejected.value, OperationError)


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ((-4.0, 1.0, 1.0), "velocity -4 rad/s exceeds 3.14 rad/s"),
        ((math.nan, 1.0, 1.0), "velocity is nan, must be a finite number"),
        ((1.0, 0.0, 1.0), "acceleration is 0, must be positive"),
        ((1.0, 1.0, 20.0), "deceleration 20 rad/s² exceeds 12.57 rad/s²"),
    ],
)
def test_a_velocity_command_beyond_a_limit_is_rejected(
    command: tuple[float, ...], text: str
) -> None:
    with pytest.raises(InvalidArgument) as rejected:
        check_jog(JOINT, 0.0, Profile(*command))
    assert str(rejected.value) == text


def test_values_on_the_limits_are_accepted() -> None:
    check_move(JOINT, 2.86, Profile(3.14, 12.57, 12.57))
    check_move(JOINT, -3.14, Profile(3.14, 12.57, 12.57))
    check_jog(JOINT, 0.0, Profile(-3.14, 12.57, 12.57))
    check_jog(JOINT, 0.0, Profile(0.0, 1.0, 1.0))


def test_an_axis_without_limits_takes_any_finite_command() -> None:
    check_move(AxisLimits.unlimited(), 1e9, Profile(1e9, 1e9, 1e9))
    with pytest.raises(InvalidArgument, match="must be a finite number"):
        check_jog(AxisLimits.unlimited(), 0.0, Profile(math.inf, 1.0, 1.0))


def test_a_linear_axis_is_rejected_in_metres() -> None:
    finger = AxisLimits(0.0, 0.045, 0.1, 1.0, unit="m")
    with pytest.raises(InvalidArgument, match=r"^target 0\.05 m exceeds 0\.045 m$"):
        check_move(finger, 0.05, Profile(0.1, 1.0, 1.0))


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"names": ("a", "a")}, "not unique"),
        ({"lower": np.zeros(3)}, "lower limits do not match 2 joints"),
        ({"lower": np.ones(2)}, "not below its upper"),
        ({"velocity": np.zeros(2)}, "must be positive"),
        ({"acceleration": np.array([1.0, np.nan])}, "must be positive"),
    ],
)
def test_limits_of_joints_must_make_sense(changed: dict[str, Any], text: str) -> None:
    parts = {
        "names": ("a", "b"),
        "lower": -np.ones(2),
        "upper": np.ones(2),
        "velocity": np.ones(2),
        "acceleration": np.ones(2),
    }
    with pytest.raises(ValueError, match=text):
        JointLimits(**{**parts, **changed})


def test_the_parts_of_a_state_have_one_shape() -> None:
    with pytest.raises(ValueError, match="differ in shape"):
        MotionState(np.zeros(3), np.zeros(3), np.zeros(2))
