"""Last points with a velocity: their run-out, and what is rejected."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.core.motion.helpers import SETTINGS, limits, peaks_of, planned, request, rows

from robotd.motion import Sampler, TrajectoryRejected

ALLOWED = SETTINGS.model_copy(update={"allow_nonzero_velocity_at_trajectory_end": True})
WIDE = ALLOWED.model_copy(update={"acceleration_margin": None, "velocity_margin": 1.0})
VELOCITIES = [[0.0] * 3, [0.6, -0.3, 0.0]]
POINTS = [[0.2, -0.1, 0.1], [0.8, -0.4, 0.1]]


def test_the_end_velocity_continues_into_a_run_out_to_rest() -> None:
    path = planned(request([1.0, 2.0], POINTS, VELOCITIES), limits(), settings=ALLOWED)
    assert path.goal_s == 2.0
    assert path.duration_s == pytest.approx(2.2)
    around = [path.state_at(2.0 + offset) for offset in (-1e-9, 1e-9)]
    for state in around:
        assert state.position == pytest.approx(POINTS[1], abs=1e-8)
        assert state.velocity == pytest.approx(VELOCITIES[1], abs=1e-6)
    end = path.state_at(path.duration_s - 1e-9)
    assert np.abs(end.velocity).max() < 1e-6
    assert end.position == pytest.approx(path.final_position, abs=1e-8)
    travelled = path.final_position - POINTS[1]
    assert travelled == pytest.approx(0.5 * 0.2 * np.array(VELOCITIES[1]))


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).filter(lambda v: max(map(abs, v)) > 0.01)
)
def test_the_run_out_is_within_the_limits_and_in_the_direction_of_the_end_velocity(
    velocity: list[float],
) -> None:
    path = planned(request([1.0], [[0.0] * 3], [velocity]), limits(), settings=WIDE)
    assert path.goal_s is not None
    times_s = np.linspace(path.goal_s, path.duration_s, 50)[:-1]
    _, speeds, accelerations = path.evaluate(times_s)
    ahead = speeds * np.sign(velocity)
    assert (ahead >= -1e-6).all()
    assert (np.diff(ahead, axis=0) <= 1e-6).all()
    assert np.abs(accelerations).max() <= 12.0 * (1.0 + 1e-6)
    assert np.abs(np.cross(speeds, velocity)).max() < 1e-6


def test_the_joint_with_the_longest_way_to_rest_sets_the_time_of_all() -> None:
    velocities = [[0.0] * 3, [2.4, -0.3, 0.0]]
    path = planned(request([1.0, 2.0], POINTS, velocities), limits(), settings=WIDE)
    assert path.duration_s == pytest.approx(2.0 + 1.5 * 2.4 / 12.0)


def test_the_sampler_reads_the_run_out_too() -> None:
    path = planned(request([1.0, 2.0], POINTS, VELOCITIES), limits(), settings=ALLOWED)
    sampler, out = Sampler(path), np.zeros((3, 3))
    for time_s in np.linspace(1.9, path.duration_s + 0.01, 40).tolist():
        sampler.sample(time_s, out)
        np.testing.assert_allclose(out, np.vstack(path.evaluate(np.array([time_s]))), atol=1e-9)


def test_a_joint_without_an_acceleration_limit_takes_a_moment_to_stop() -> None:
    path = planned(request([1.0, 2.0], POINTS, VELOCITIES), settings=ALLOWED)
    assert path.duration_s == pytest.approx(2.2)


def test_without_a_velocity_at_the_end_nothing_follows() -> None:
    path = planned(request([1.0, 2.0], POINTS, rows(0.1, 0.0)), limits(), settings=ALLOWED)
    assert (path.goal_s, path.duration_s) == (None, 2.0)
    assert peaks_of(path).velocity.value.max() > 0.1


def test_by_default_a_velocity_at_the_end_is_rejected() -> None:
    with pytest.raises(
        TrajectoryRejected, match=r"joint1 at 2\.000 s: velocity 0\.6 rad/s .*end is"
    ):
        planned(request([1.0, 2.0], POINTS, VELOCITIES), limits())


def test_a_velocity_at_time_0_is_rejected() -> None:
    with pytest.raises(TrajectoryRejected, match="must be 0 at time 0"):
        planned(request([0.0], [[0.0] * 3], [[0.5, 0.0, 0.0]]), limits(), settings=ALLOWED)


def test_a_braking_distance_beyond_a_position_limit_is_rejected() -> None:
    points = [[0.0] * 3, [0.0, -2.99, 0.0]]
    velocities = [[0.0] * 3, [0.0, -1.0, 0.0]]
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(request([1.0, 8.0], points, velocities), limits(), settings=ALLOWED)
    assert str(rejected.value) == (
        "joint2 at 8.000 s: braking from -1 rad/s at the last point ends at -3.09 rad, beyond its"
        " position limit -3 rad"
    )
