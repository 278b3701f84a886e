"""Trajectories of planners: accepted as they are, and with a start that is a little off."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.motion.helpers import NAMES, at_rest, limits, peaks_of, planned, request
from tests.core.motion.profiles import time_optimal

from robotd.motion import Interpolation, MotionState, TrajectoryRejected, TrajectoryRequest
from robotd.motion.path_ends import ACCELERATION_SHARE

VELOCITY, ACCELERATION = 3.14, 12.57
JOINTS = limits(position=7.0, velocity=VELOCITY, acceleration=ACCELERATION)
GIVEN = ["p", "pv", "pva"]  # positions, velocities, accelerations
DEVIATIONS = [0.0005, -0.003, 0.0099]


def totg(
    distance: float,
    step_s: float,
    given: str,
    deviation: float = 0.0,
    first: int = 0,
    acceleration: float = ACCELERATION,
) -> TrajectoryRequest:
    """Joint 1 at full acceleration, joint 2 the other way at half of it, joint 3 at rest."""
    times_s, *profile = time_optimal(distance, VELOCITY, acceleration, step_s)
    tables = [np.outer(values, [1.0, -0.5, 0.0])[first:] for values in profile]
    tables[0] = tables[0] + deviation
    return request(
        times_s[first:],
        tables[0],
        tables[1] if "v" in given else None,
        tables[2] if "a" in given else None,
    )


@given(st.floats(0.002, 6.0), st.sampled_from([0.01, 0.02, 0.05, 0.1]), st.sampled_from(GIVEN))
def test_time_optimal_paths_pass_although_they_overshoot_between_the_points(
    distance: float, step_s: float, given: str
) -> None:
    planned(totg(distance, step_s, given), JOINTS)


@given(
    st.floats(0.3, 6.0),
    st.sampled_from([0.01, 0.05, 0.1]),
    st.sampled_from(GIVEN),
    st.floats(-0.0099, 0.0099),
)
def test_a_start_deviation_costs_no_more_than_a_share_of_the_limit(
    distance: float, step_s: float, given: str, deviation: float
) -> None:
    exact = peaks_of(planned(totg(distance, step_s, given), JOINTS)).acceleration.value
    trajectory = planned(totg(distance, step_s, given, deviation), JOINTS)
    bound = np.maximum(exact, ACCELERATION) + ACCELERATION_SHARE * ACCELERATION
    assert (peaks_of(trajectory).acceleration.value <= 1.02 * bound).all()
    begin = trajectory.state_at(0.0)
    np.testing.assert_allclose(begin.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(begin.velocity, 0.0, atol=1e-12)


@pytest.mark.parametrize("given", GIVEN)
@pytest.mark.parametrize("deviation", DEVIATIONS)
def test_a_blended_path_ends_on_the_clients_path(given: str, deviation: float) -> None:
    asked = totg(2.0, 0.01, given, deviation)
    trajectory = planned(asked, JOINTS)
    assert trajectory.kind is Interpolation.BLENDED
    late = asked.times_s > 0.25
    late[-1] = False
    position, velocity, _ = trajectory.evaluate(asked.times_s[late])
    np.testing.assert_allclose(position, asked.positions[late], atol=1e-9)
    if asked.velocities is not None:
        np.testing.assert_allclose(velocity, asked.velocities[late], atol=1e-9)
    np.testing.assert_array_equal(trajectory.final_position, asked.positions[-1])


@pytest.mark.parametrize("given", GIVEN)
@pytest.mark.parametrize("deviation", DEVIATIONS)
def test_a_dense_path_without_a_point_at_time_zero_is_blended_too(
    given: str, deviation: float
) -> None:
    trajectory = planned(totg(1.0, 0.01, given, deviation, first=1), JOINTS)
    assert (peaks_of(trajectory).acceleration.value <= 1.5 * ACCELERATION).all()
    np.testing.assert_allclose(trajectory.state_at(0.0).position, 0.0, atol=1e-12)


def test_without_a_deviation_the_path_is_the_clients() -> None:
    asked = totg(1.0, 0.1, "pva")
    trajectory = planned(asked, JOINTS)
    assert trajectory.kind is Interpolation.QUINTIC_HERMITE
    assert asked.accelerations is not None
    np.testing.assert_array_equal(trajectory.state_at(0.0).acceleration, asked.accelerations[0])


@given(
    st.sampled_from(GIVEN),
    st.floats(-1.0, 1.0),
    st.floats(0.0, 0.2),
    st.sampled_from([0.01, 0.05]),
)
def test_replanning_in_motion_from_where_the_joints_were(
    given: str, speed: float, age_s: float, step_s: float
) -> None:
    """The client plans from rest, at a position that is ``age_s`` old."""
    velocity = np.array([speed, -0.5 * speed, 0.0])
    start = MotionState(np.zeros(3), velocity, np.zeros(3))
    recent_path = np.outer(np.linspace(-0.25, 0.25, 161), velocity)
    asked = totg(1.5, step_s, given, acceleration=4.0)
    asked.positions[:] -= age_s * velocity
    trajectory = planned(asked, JOINTS, start, recent_path=recent_path)
    begin = trajectory.state_at(0.0)
    np.testing.assert_allclose(begin.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(begin.velocity, velocity, atol=1e-12)
    assert (peaks_of(trajectory).acceleration.value <= 1.25 * ACCELERATION).all()
    np.testing.assert_array_equal(trajectory.final_position, asked.positions[-1])


def test_replanning_from_a_place_off_the_way_is_rejected() -> None:
    velocity = np.array([1.0, 0.0, 0.0])
    start = MotionState(np.zeros(3), velocity, np.zeros(3))
    recent_path = np.outer(np.linspace(-0.25, 0.25, 161), velocity)
    asked = request([0.0, 2.0], [[-0.1, 0.02, 0.0], [1.0, 0.0, 0.0]])
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(asked, JOINTS, start, recent_path=recent_path)
    assert str(rejected.value) == (
        "joint2 at 0.000 s: first point 0.02 is 0.02 rad away from the recent path, at 0, "
        "start tolerance 0.01 rad"
    )
    assert len(NAMES) == 3


def test_a_place_on_the_way_counts_for_all_joints_at_the_same_time() -> None:
    recent_path = np.outer(np.linspace(-0.25, 0.25, 161), [1.0, 1.0, 0.0])
    with pytest.raises(TrajectoryRejected, match="start tolerance"):
        planned(
            request([0.0, 2.0], [[-0.1, 0.1, 0.0], [1.0, 0.0, 0.0]]),
            JOINTS,
            at_rest(),
            recent_path=recent_path,
        )
