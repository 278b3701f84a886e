"""Requests that are rejected whatever the state of the robot, by text and code."""

import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.motion.helpers import (
    NAMES,
    SETTINGS,
    limits,
    planned,
    request,
    requests,
    rows,
    states,
)

from robotd.arrays import FloatArray
from robotd.descriptor import TrajectorySettings
from robotd.motion import (
    Interpolation,
    MotionState,
    RejectionCode,
    TrajectoryRejected,
    TrajectoryRequest,
)
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
            "unknown joint 'elbow' (available: joint1, joint2, joint3)",
        ),
        (named("joint1", "joint2", "joint2"), "joint 'joint2' is given 2 times"),
    ],
)
def test_wrong_joints_are_rejected_as_such(asked: TrajectoryRequest, text: str) -> None:
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(asked, limits())
    assert str(rejected.value) == text
    assert rejected.value.code is RejectionCode.INVALID_JOINTS


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        (request([], np.zeros((0, 3))), "the trajectory has no points"),
        (
            request(np.arange(1, 3002), np.zeros((3001, 3))),
            "3001 points exceed the limit of 3000",
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
def test_wrong_points_are_rejected_as_such(asked: TrajectoryRequest, text: str) -> None:
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(asked, limits())
    assert str(rejected.value) == text
    assert rejected.value.code is RejectionCode.INVALID_GOAL


def test_three_thousand_points_are_accepted() -> None:
    trajectory = planned(request(np.arange(1, 3001), np.zeros((3000, 3))))
    assert SETTINGS.max_points == 3000
    assert trajectory.duration_s == 3000.0


def test_the_times_in_a_rejection_differ() -> None:
    with pytest.raises(
        TrajectoryRejected, match=r"time 1234567\.1 s is not after the 1234567\.2 s"
    ):
        planned(request([1234567.2, 1234567.1], rows(0, 0)))


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


def test_rows_without_points_are_rejected_by_the_plan() -> None:
    with pytest.raises(TrajectoryRejected, match="the trajectory has no points"):
        planned(TrajectoryRequest.from_rows(NAMES, [], []))


@pytest.mark.parametrize(
    ("tables", "text"),
    [
        (([[1, 2, 3], [4, 5]],), "point 1: 2 positions for 3 joints"),
        (([[], []],), "the points have no positions"),
        ((rows(0, 0), [[0, 0], []]), "point 0: 2 velocities for 3 joints"),
        ((rows(0, 0), rows(0, 0), [[0, 0, 0, 0], []]), "point 0: 4 accelerations for 3 joints"),
    ],
)
def test_ragged_rows_are_rejected(tables: tuple[Rows, ...], text: str) -> None:
    with pytest.raises(TrajectoryRejected) as rejected:
        TrajectoryRequest.from_rows(NAMES, TIMES, *tables)
    assert str(rejected.value) == text


@pytest.mark.parametrize(
    ("velocities", "accelerations", "note"),
    [
        ([[0.1] * 3, []], [], "velocities are ignored: only 1 of 2 points have them"),
        (
            [[], [0.1] * 3],
            [[0.2] * 3, [0.2] * 3],
            (
                "velocities are ignored: only 1 of 2 points have them; "
                "accelerations are ignored, because velocities are"
            ),
        ),
    ],
)
def test_velocities_of_some_points_are_ignored_with_a_note(
    velocities: Rows, accelerations: Rows, note: str
) -> None:
    asked = TrajectoryRequest.from_rows(NAMES, TIMES, rows(0.1, 0.2), velocities, accelerations)
    trajectory = planned(asked)
    assert trajectory.kind is Interpolation.CUBIC_SPLINE
    assert "; ".join(trajectory.notes) == note


def test_accelerations_of_some_points_are_ignored_and_velocities_used() -> None:
    asked = TrajectoryRequest.from_rows(
        NAMES, TIMES, rows(0.1, 0.2), rows(0.1, 0.0), [[0.3] * 3, []]
    )
    trajectory = planned(asked)
    assert trajectory.kind is Interpolation.CUBIC_HERMITE
    assert trajectory.notes == ("accelerations are ignored: only 1 of 2 points have them",)


@given(requests(), st.integers(1, 2), states())
def test_joints_that_a_request_lacks_hold_their_position(
    asked: TrajectoryRequest, count: int, start: MotionState
) -> None:
    def part(table: FloatArray | None) -> FloatArray | None:
        return None if table is None else table[:, :count]

    partial = TrajectoryRequest(
        NAMES[:count],
        asked.times_s,
        asked.positions[:, :count],
        part(asked.velocities),
        part(asked.accelerations),
    )
    start.velocity[count:] = start.acceleration[count:] = 0.0
    trajectory = planned(partial, start=start)
    times_s = np.linspace(0.0, trajectory.duration_s, 50)
    held = np.broadcast_to(start.position[count:], (50, len(NAMES) - count))
    np.testing.assert_allclose(trajectory.evaluate(times_s)[0][:, count:], held, atol=1e-12)
    np.testing.assert_array_equal(trajectory.final_position[:count], asked.positions[-1, :count])


def test_a_joint_that_a_request_lacks_must_stand() -> None:
    moving = MotionState(np.zeros(3), np.array([0.0, 0.0, 0.2]), np.zeros(3))
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(request([1.0], [[0.1, 0.1]], names=NAMES[:2]), start=moving)
    assert rejected.value.code is RejectionCode.INVALID_JOINTS
    assert str(rejected.value) == (
        "missing joint joint3: it moves with 0.2 rad/s and cannot be held; name it, or wait "
        "until it is at rest"
    )


def test_the_descriptor_may_demand_every_joint() -> None:
    settings = TrajectorySettings(allow_partial_joints_goal=False)
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(named("joint3"), settings=settings)
    assert rejected.value.code is RejectionCode.INVALID_JOINTS
    assert str(rejected.value) == (
        "missing joint joint1, joint2: every joint must be named"
        " (trajectory.allow_partial_joints_goal is false)"
    )
