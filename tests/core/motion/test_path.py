"""Motion from the start to the first point: a dwell, a move, or a blend."""

from __future__ import annotations

import numpy as np
import pytest
from tests.core.motion.helpers import at_rest, limits, peaks_of, planned, request, rows

from robotd.motion import MotionState, TrajectoryRejected, plan_stop


def test_a_first_point_at_the_present_position_is_a_dwell() -> None:
    trajectory = planned(request([1.0, 1.5], rows(0.0, 0.3)))
    np.testing.assert_array_equal(trajectory.breaks, [0.0, 1.0, 1.5])
    position, velocity, acceleration = trajectory.evaluate(np.linspace(0.0, 0.999, 50))
    for values in (position, velocity, acceleration):
        np.testing.assert_array_equal(values, 0.0)
    np.testing.assert_allclose(trajectory.state_at(1.25).position, 0.15)
    assert trajectory.duration_s == 1.5


def test_a_dwell_with_velocities_stands_still() -> None:
    trajectory = planned(request([1.0, 1.5], rows(0.0, 0.3), rows(0.0, 0.0)))
    np.testing.assert_array_equal(trajectory.evaluate(np.linspace(0.0, 1.0, 50))[0], 0.0)


def test_a_dwell_can_be_stopped() -> None:
    trajectory = planned(request([1.0, 1.5], rows(0.0, 0.3)))
    rest_s, _, _ = plan_stop(trajectory, 0.5, limits()).at(np.inf)
    np.testing.assert_array_equal(trajectory.state_at(rest_s).position, 0.0)


def test_a_moving_start_has_no_dwell() -> None:
    moving = MotionState(np.zeros(3), np.full(3, 0.2), np.zeros(3))
    trajectory = planned(request([1.0, 1.5], rows(0.0, 0.3)), start=moving)
    np.testing.assert_array_equal(trajectory.state_at(0.0).velocity, 0.2)
    np.testing.assert_allclose(trajectory.state_at(1.0).position, 0.0, atol=1e-12)


def test_a_dense_path_that_begins_a_period_late_does_not_wait_for_its_first_point() -> None:
    times_s = np.arange(1, 101) * 0.01
    positions = 0.5 * (1.0 - np.cos(np.pi * times_s)) / 2.0
    trajectory = planned(request(times_s, np.outer(positions, np.ones(3))), limits())
    assert peaks_of(trajectory).acceleration.value.max() < 5.0


def test_a_first_point_that_cannot_be_reached_in_its_time_is_rejected() -> None:
    with pytest.raises(TrajectoryRejected, match=r"acceleration .* exceeds 12 rad/s²"):
        planned(request([0.05, 1.0], rows(0.1, 0.3)), limits())


def test_a_deviation_that_the_limits_need_longer_for_takes_longer() -> None:
    times_s = np.arange(0, 201) * 0.01
    positions = np.outer(0.2 * (1.0 - np.cos(np.pi * times_s / 2.0)), np.ones(3))
    ends = []
    for acceleration in (12.0, 3.0):
        trajectory = planned(
            request(times_s, positions + 0.008), limits(acceleration=acceleration), at_rest()
        )
        off = np.abs(trajectory.evaluate(times_s)[0] - positions - 0.008).max(axis=1)
        ends.append(float(times_s[np.argmax(off < 1e-9)]))
        assert (peaks_of(trajectory).acceleration.value <= 1.05 * acceleration).all()
    assert ends[1] > 1.6 * ends[0]
    assert ends[0] < 0.2
