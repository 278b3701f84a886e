"""Tolerances of a goal are honoured, or the goal is rejected."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.motion.helpers import NAMES, limits

from robotd.arrays import FloatArray
from robotd.control.groups.descriptor_limits import trajectory_rules
from robotd.descriptor import TrajectorySettings
from robotd.motion import JointTolerance, RejectionCode, Tolerances, TrajectoryRejected

SETTINGS = TrajectorySettings(
    path_tolerance_rad=0.02, goal_tolerance_rad=0.01, goal_time_s=2.0, stopped_velocity_rad_s=0.05
)
RULES = trajectory_rules(SETTINGS, ["rad"] * 3)
ZERO = np.zeros(3)
RULE = ", must be positive, 0 (default) or -1 (no limit)"


def of_goal(
    *path: JointTolerance, goal: Iterable[JointTolerance] = (), goal_time_s: float = 0.0
) -> Tolerances:
    return Tolerances(limits(), RULES, path, goal, goal_time_s)


def off(joint: int, error: float) -> FloatArray:
    actual = np.zeros(3)
    actual[joint] = error
    return actual


def test_without_entries_the_defaults_apply() -> None:
    tolerances = of_goal()
    np.testing.assert_array_equal(tolerances.path.position, 0.02)
    np.testing.assert_array_equal(tolerances.path.velocity, np.inf)
    np.testing.assert_array_equal(tolerances.goal.position, 0.01)
    np.testing.assert_array_equal(tolerances.goal.velocity, 0.05)
    assert tolerances.goal_time_s == 2.0


def test_zero_is_the_default_minus_one_no_limit_and_a_value_itself() -> None:
    tolerances = of_goal(
        JointTolerance("joint3", position=0.5, velocity=0.1),
        JointTolerance("joint1", position=-1.0),
        goal=[JointTolerance("joint2", velocity=-1.0)],
        goal_time_s=-1.0,
    )
    np.testing.assert_array_equal(tolerances.path.position, [np.inf, 0.02, 0.5])
    np.testing.assert_array_equal(tolerances.path.velocity, [np.inf, np.inf, 0.1])
    np.testing.assert_array_equal(tolerances.goal.position, 0.01)
    np.testing.assert_array_equal(tolerances.goal.velocity, [0.05, np.inf, 0.05])
    assert tolerances.goal_time_s == np.inf
    assert of_goal(goal_time_s=0.5).goal_time_s == 0.5


@pytest.mark.parametrize(
    ("make", "text", "code"),
    [
        (
            lambda: of_goal(JointTolerance("elbow", 0.1)),
            "path tolerance: unknown joint: 'elbow'",
            RejectionCode.INVALID_JOINTS,
        ),
        (
            lambda: of_goal(goal=[JointTolerance("joint1"), JointTolerance("joint1")]),
            "goal tolerance: joint given twice: 'joint1'",
            RejectionCode.INVALID_JOINTS,
        ),
        (
            lambda: of_goal(JointTolerance("joint2", position=-0.5)),
            "joint2: path tolerance of position is -0.5" + RULE,
            RejectionCode.INVALID_GOAL,
        ),
        (
            lambda: of_goal(goal=[JointTolerance("joint2", velocity=np.nan)]),
            "joint2: goal tolerance of velocity is nan" + RULE,
            RejectionCode.INVALID_GOAL,
        ),
        (
            lambda: of_goal(JointTolerance("joint2", acceleration=-2.0)),
            "joint2: path tolerance of acceleration is -2" + RULE,
            RejectionCode.INVALID_GOAL,
        ),
        (
            lambda: of_goal(goal_time_s=-3.0),
            "goal time tolerance is -3" + RULE,
            RejectionCode.INVALID_GOAL,
        ),
    ],
)
def test_what_cannot_be_honoured_is_rejected(
    make: Callable[[], Tolerances], text: str, code: RejectionCode
) -> None:
    with pytest.raises(TrajectoryRejected) as rejected:
        make()
    assert str(rejected.value) == text
    assert rejected.value.code is code


def test_an_acceleration_tolerance_is_said_to_be_unwatched() -> None:
    assert of_goal(JointTolerance("joint1", acceleration=2.0)).notes == (
        "joint1: path tolerance of acceleration is ignored: it is not measured",
    )
    assert of_goal(JointTolerance("joint1", acceleration=-1.0)).notes == ()


def test_a_path_violation_names_joint_time_error_and_limit() -> None:
    violation = of_goal().path.check(0.84, ZERO, off(1, -0.031), ZERO, ZERO)
    assert str(violation) == (
        "joint2 at 0.840 s: position error 0.031 rad exceeds path tolerance 0.02 rad"
    )


def test_a_goal_is_reached_at_standstill_only() -> None:
    tolerances = of_goal()
    assert tolerances.check_goal(2.0, ZERO, off(0, 0.009), off(2, 0.04)) is None
    assert str(tolerances.check_goal(2.0, ZERO, ZERO, off(2, -0.06))) == (
        "joint3 at 2.000 s: velocity error 0.06 rad/s exceeds goal tolerance 0.05 rad/s"
    )


def test_the_worst_joint_is_named() -> None:
    tolerances = of_goal(JointTolerance("joint1", position=0.001))
    violation = tolerances.path.check(1.0, ZERO, np.array([0.002, 0.03, 0.0]), ZERO, ZERO)
    assert violation is not None
    assert violation.joint == "joint1"


def test_a_value_that_is_not_a_number_is_never_within() -> None:
    violation = of_goal().path.check(1.0, ZERO, np.array([0.03, np.nan, 0.0]), ZERO, ZERO)
    assert violation is not None
    assert violation.joint == "joint2"
    unlimited = of_goal(JointTolerance("joint2", position=-1.0))
    assert unlimited.path.check(1.0, ZERO, off(1, np.nan), ZERO, ZERO) is not None


def test_a_velocity_nobody_limits_may_be_unknown() -> None:
    assert of_goal().path.check(1.0, ZERO, ZERO, ZERO, np.full(3, np.nan)) is None


@given(
    st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3),
    st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3),
)
def test_a_violation_is_reported_exactly_when_an_error_exceeds_its_limit(
    desired: list[float], actual: list[float]
) -> None:
    error = np.abs(np.array(desired) - np.array(actual))
    violation = of_goal().path.check(0.0, np.array(desired), np.array(actual), ZERO, ZERO)
    assert (violation is not None) == bool((error > 0.02).any())
    if violation is not None:
        assert violation.error == error.max() == error[NAMES.index(violation.joint)]
