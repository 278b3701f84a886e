"""What is refused before the state of the robot matters, by text and code."""

import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.motion.helpers import NAMES, SETTINGS, limits, planned, request, requests, rows

from robotd.motion import RejectionCode, TrajectoryRejected, TrajectoryRequest
from robotd.motion.request import Rows

TIMES = [1.0, 2.0]


def named(*names: str) -> TrajectoryRequest:
    return request([1.0], [[0.0] * len(names)], names=names)


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        (named(), "the trajectory names no joints"),
        (
            named("joint1", "joint2", "elbow"),
            "unknown joint 'elbow'; the joints are joint1, joint2, joint3",
        ),
        (named("joint1", "joint2", "joint2"), "joint 'joint2' is given 2 times"),
        (named("joint3"), "missing joint joint1, joint2: every joint must be named"),
    ],
)
def test_wrong_joints_are_refused_as_such(asked: TrajectoryRequest, text: str) -> None:
    with pytest.raises(TrajectoryRejected) as refused:
        planned(asked, limits())
    assert str(refused.value) == text
    assert refused.value.code is RejectionCode.INVALID_JOINTS


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        (request([], np.zeros((0, 3))), "the trajectory has no points"),
        (
            request(np.arange(1, 1002), np.zeros((1001, 3))),
            "1001 points exceed the limit of 1000",
        ),
        (
            request(TIMES, rows(0, 0), None, rows(0, 0)),
            "accelerations are given without velocities",
        ),
        (
            request(TIMES, [[0.0] * 2] * 2),
            "positions have the shape (2, 2), 2 points of 3 joints need (2, 3)",
        ),
        (
            request(TIMES, rows(0, 0), [[0.0] * 4] * 2),
            "velocities have the shape (2, 4), 2 points of 3 joints need (2, 3)",
        ),
        (request([-0.5, 1.0], rows(0, 0)), "point 0: time -0.5 s is outside 0 to 2.14748e+09 s"),
        (request([1.0, np.nan], rows(0, 0)), "point 1: time nan s is outside 0 to 2.14748e+09 s"),
        (request([1.0, np.inf], rows(0, 0)), "point 1: time inf s is outside 0 to 2.14748e+09 s"),
        (
            request([1.0, 2.0, 1.5], rows(0, 0, 0)),
            "point 2: time 1.5 s is not after the 2 s of point 1",
        ),
        (
            request(TIMES, [[0, 0, 0], [0, np.nan, 0]]),
            "joint2 at 2.000 s (point 1): position is nan",
        ),
        (
            request(TIMES, rows(0, 0), [[0, 0, np.inf], [0, 0, 0]]),
            "joint3 at 1.000 s (point 0): velocity is inf",
        ),
        (
            request(TIMES, rows(0, 0), rows(0, 0), [[-np.inf, 0, 0], [0, 0, 0]]),
            "joint1 at 1.000 s (point 0): acceleration is -inf",
        ),
    ],
)
def test_wrong_points_are_refused_as_such(asked: TrajectoryRequest, text: str) -> None:
    with pytest.raises(TrajectoryRejected) as refused:
        planned(asked, limits())
    assert str(refused.value) == text
    assert refused.value.code is RejectionCode.INVALID_GOAL


def test_a_thousand_points_are_accepted() -> None:
    trajectory = planned(request(np.arange(1, 1001), np.zeros((1000, 3))))
    assert SETTINGS.max_points == 1000
    assert trajectory.duration_s == 1000.0


@given(requests(), st.permutations(range(len(NAMES))))
def test_the_order_of_names_does_not_matter(asked: TrajectoryRequest, order: list[int]) -> None:
    shuffled = TrajectoryRequest(
        tuple(NAMES[joint] for joint in order),
        asked.times_s,
        asked.positions[:, order],
        None if asked.velocities is None else asked.velocities[:, order],
        None if asked.accelerations is None else asked.accelerations[:, order],
    )
    first, second = planned(asked), planned(shuffled)
    assert first.names == second.names == NAMES
    np.testing.assert_array_equal(first.coefficients, second.coefficients)


def test_rows_of_messages_become_tables() -> None:
    asked = TrajectoryRequest.from_rows(
        list(NAMES),
        TIMES,
        [array.array("d", [1, 2, 3]), array.array("d", [4, 5, 6])],
        [array.array("d"), array.array("d")],
    )
    np.testing.assert_array_equal(asked.positions, [[1, 2, 3], [4, 5, 6]])
    assert asked.velocities is None
    assert asked.accelerations is None


def test_rows_without_points_are_refused_by_the_plan() -> None:
    with pytest.raises(TrajectoryRejected, match="the trajectory has no points"):
        planned(TrajectoryRequest.from_rows(NAMES, [], []))


@pytest.mark.parametrize(
    ("tables", "text"),
    [
        (([[1, 2, 3], [4, 5]],), "point 1: 2 positions for 3 joints"),
        (([[], []],), "the points have no positions"),
        ((rows(0, 0), [[0, 0, 0], []]), "point 1: 0 velocities for 3 joints"),
        ((rows(0, 0), rows(0, 0), [[0, 0, 0, 0], []]), "point 0: 4 accelerations for 3 joints"),
    ],
)
def test_ragged_rows_are_refused(tables: tuple[Rows, ...], text: str) -> None:
    with pytest.raises(TrajectoryRejected) as refused:
        TrajectoryRequest.from_rows(NAMES, TIMES, *tables)
    assert str(refused.value) == text
