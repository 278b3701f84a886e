"""Points for a device that joins them by a spline: few enough, and close enough to the path."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from tests.core.motion.helpers import at_rest, limits, planned, request, rows, tables

from robotd.arrays import FloatArray
from robotd.motion import Trajectory, TrajectoryRejected, TrajectoryRequest, spline_points
from robotd.motion.spline_points import MAX_ERROR


def error(trajectory: Trajectory, times_s: FloatArray, positions: FloatArray) -> float:
    """Largest distance between the path and scipy's spline at rest at both ends."""
    checked_s = np.linspace(0.0, trajectory.duration_s, 20_001)
    spline = CubicSpline(times_s, positions, bc_type="clamped")(checked_s)
    return float(np.abs(spline - trajectory.evaluate(checked_s)[0]).max())


def dense(count: int, *, velocities: bool = False) -> TrajectoryRequest:
    times_s = np.arange(1, count + 1) * 0.01
    share = np.minimum(1.0, np.minimum(times_s, times_s[-1] - times_s))
    envelope = share**2 * (3.0 - 2.0 * share)
    positions = envelope[:, None] * np.sin(np.outer(times_s, [0.9, 1.7, 0.4]))
    slopes = np.gradient(positions, times_s, axis=0)
    slopes[-1] = 0.0
    return request(times_s, positions, slopes if velocities else None)


def test_a_spline_that_is_short_enough_is_handed_over_as_it_is() -> None:
    trajectory = planned(request([0.5, 1.0], rows(0.2, 0.5)))
    times_s, positions = spline_points(trajectory, 3)
    np.testing.assert_array_equal(times_s, trajectory.breaks)
    np.testing.assert_array_equal(positions, trajectory.knot_positions)


@pytest.mark.parametrize("velocities", [False, True])
@pytest.mark.parametrize("limit", [400, 1000, 4000])
def test_a_long_path_becomes_a_spline_of_bounded_error(limit: int, velocities: bool) -> None:
    trajectory = planned(dense(3000, velocities=velocities))
    times_s, positions = spline_points(trajectory, limit)
    assert len(times_s) <= limit
    assert error(trajectory, times_s, positions) <= 1.5 * MAX_ERROR
    np.testing.assert_array_equal(positions[[0, -1]], trajectory.knot_positions[[0, -1]])


def test_a_path_that_needs_more_points_is_rejected_with_both_numbers() -> None:
    trajectory = planned(dense(3000))
    with pytest.raises(TrajectoryRejected) as rejected:
        spline_points(trajectory, 40)
    assert str(rejected.value).startswith(
        "the device takes 40 points, and a spline within 0.1 mrad of the path of 3001 points needs "
    )


def test_a_dwell_and_a_blend_are_sampled() -> None:
    for asked in (request([1.0, 1.5], rows(0.0, 0.3)), dense(300)):
        trajectory = planned(asked)
        assert error(trajectory, *spline_points(trajectory, 1000)) <= 1.5 * MAX_ERROR
    dense_from_zero = TrajectoryRequest(
        asked.joint_names, np.append(0.0, asked.times_s), np.vstack([np.zeros(3), asked.positions])
    )
    trajectory = planned(dense_from_zero, limits(), at_rest(0.005))
    assert error(trajectory, *spline_points(trajectory, 1000)) <= 1.5 * MAX_ERROR


@settings(max_examples=30)
@given(tables(6, 0.5), tables(6, 0.5), st.floats(0.2, 1.0))
def test_any_hermite_path_is_followed(
    positions: FloatArray, velocities: FloatArray, step_s: float
) -> None:
    velocities[-1] = 0.0
    trajectory = planned(request(np.arange(1, 7) * step_s, positions, velocities))
    assert error(trajectory, *spline_points(trajectory, 2000)) <= 1.5 * MAX_ERROR
