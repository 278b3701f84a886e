"""Merging, the first point, the end: how points meet the state of the robot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.motion.helpers import (
    NAMES,
    at_rest,
    peaks_of,
    planned,
    request,
    requests,
    rows,
    states,
)

from robotd.motion import MotionState, TrajectoryRejected, TrajectoryRequest


def test_points_less_than_a_millisecond_apart_are_merged_into_the_first() -> None:
    trajectory = planned(request([1.0, 1.0005, 1.0009, 2.0], rows(0.1, 0.2, 0.3, 0.4)))
    np.testing.assert_allclose(trajectory.breaks, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(trajectory.knot_positions[:, 0], [0.0, 0.1, 0.4])
    assert trajectory.notes == ("2 points less than 1 ms after another were merged",)


def test_the_last_point_is_never_lost_by_merging() -> None:
    trajectory = planned(request([1.0, 2.0, 2.0005], rows(0.1, 0.2, 0.3)))
    np.testing.assert_allclose(trajectory.breaks, [0.0, 1.0, 2.0005])
    np.testing.assert_array_equal(trajectory.final_position, [0.3] * 3)


@given(st.lists(st.floats(0.0, 0.003), min_size=1, max_size=30))
def test_after_merging_times_rise_by_a_millisecond_and_the_last_point_stays(
    gaps: list[float],
) -> None:
    times = 0.01 + np.cumsum(gaps)
    trajectory = planned(request(times, np.full((len(times), 3), 0.3)))
    assert (np.diff(trajectory.breaks) > 0.999e-3).all()
    assert trajectory.duration_s == times[-1]
    np.testing.assert_array_equal(trajectory.final_position, [0.3] * 3)


def test_points_exactly_a_millisecond_apart_stay_although_decimals_round() -> None:
    times = [0.3 + 0.001 * step for step in range(50)]
    assert len(planned(request(times, np.zeros((50, 3)) + 0.2)).breaks) == 51


def test_the_same_point_twice_counts_once() -> None:
    assert len(planned(request([1.0, 1.0, 2.0], rows(0.1, 0.1, 0.2))).breaks) == 3


def test_two_places_at_the_same_time_are_rejected() -> None:
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(request([1.0, 1.0], [[0, 0.1, 0], [0, 0.4, 0]]))
    assert str(rejected.value) == (
        "joint2 at 1.000 s: point 1 is not later than point 0 but asks for 0.4 rad after 0.1"
    )


def test_a_single_point_is_a_plain_move_in_its_time() -> None:
    trajectory = planned(request([2.0], rows(1.0)))
    assert trajectory.duration_s == 2.0
    np.testing.assert_allclose(trajectory.state_at(1.0).position, 0.5)
    np.testing.assert_allclose(peaks_of(trajectory).velocity.value, 1.5 * 1.0 / 2.0)


def test_a_first_point_elsewhere_is_reached_in_its_own_time() -> None:
    trajectory = planned(request([0.5, 1.0], rows(0.2, 0.3)))
    np.testing.assert_allclose(trajectory.state_at(0.5).position, 0.2)
    np.testing.assert_array_equal(trajectory.state_at(0.0).position, 0.0)


def test_a_single_point_at_the_present_position_keeps_its_time() -> None:
    trajectory = planned(request([0.5], rows(0.0)))
    assert trajectory.duration_s == 0.5


@pytest.mark.parametrize("time_s", [0.0, 0.0005])
def test_a_near_first_point_at_time_zero_gives_way_to_the_start(time_s: float) -> None:
    trajectory = planned(request([time_s, 1.0], rows(0.009, 0.3)))
    np.testing.assert_array_equal(trajectory.state_at(0.0).position, 0.0)
    np.testing.assert_array_equal(trajectory.breaks, [0.0, 1.0])


def test_a_far_first_point_at_time_zero_is_rejected() -> None:
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(request([0.0, 1.0], [[0, 0, 0.5], [0, 0, 1]]))
    assert str(rejected.value) == (
        "joint3 at 0.000 s: first point 0.5 is 0.5 rad away from the present position 0, "
        "start tolerance 0.01 rad"
    )


def test_a_goal_that_is_reached_already_stands_still() -> None:
    trajectory = planned(request([0.0], rows(0.005)))
    np.testing.assert_array_equal(trajectory.final_position, 0.0)
    np.testing.assert_array_equal(peaks_of(trajectory).velocity.value, 0.0)
    assert 0.0 < trajectory.duration_s <= 0.001


def test_a_goal_that_leaves_no_time_to_stop_is_rejected() -> None:
    moving = MotionState(np.zeros(3), np.array([0.0, -0.5, 0.0]), np.zeros(3))
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(request([0.0], rows(0.0)), start=moving)
    assert str(rejected.value) == (
        "joint2 at 0.000 s: the last point leaves no time to stop from -0.5 rad/s"
    )


def test_a_last_point_that_moves_is_rejected() -> None:
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(request([1.0, 2.0], rows(0.1, 0.2), [[0, 0, 0], [0.1, -0.2, 0]]))
    assert str(rejected.value) == (
        "joint2 at 2.000 s: velocity -0.2 rad/s at the last point, must be 0"
        " (trajectory.allow_nonzero_velocity_at_trajectory_end is false)"
    )


def test_zero_that_went_through_single_precision_is_standstill() -> None:
    trajectory = planned(request([1.0], rows(0.1), rows(1e-8)))
    np.testing.assert_array_equal(trajectory.state_at(1.0).velocity, 0.0)


@given(requests(), states())
def test_the_splice_is_continuous(asked: TrajectoryRequest, start: MotionState) -> None:
    trajectory = planned(asked, start=start)
    begin = trajectory.state_at(0.0)
    np.testing.assert_array_equal(begin.position, start.position)
    np.testing.assert_array_equal(begin.velocity, start.velocity)
    if asked.accelerations is not None:
        np.testing.assert_array_equal(begin.acceleration, start.acceleration)


def test_a_start_that_is_not_known_is_rejected() -> None:
    start = at_rest()
    start.position[1] = np.nan
    with pytest.raises(TrajectoryRejected, match="joint2: the present position is not known"):
        planned(request([1.0], rows(0.0)), start=start)


def test_a_start_of_other_joints_is_a_mistake_of_the_caller() -> None:
    with pytest.raises(ValueError, match="for 3 joints"):
        planned(request([1.0], rows(0.0)), start=MotionState.at_rest(np.zeros(2)))
    assert len(NAMES) == 3
