"""Trajectories as the engine gets them, and requests rejected before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import ConnectError, OperationError
from robotd_wmx import _native
from robotd_wmx.splines import CLOSEST_UNITS, check, engine_points
from robots import goal, running


def test_the_start_is_left_to_the_engine() -> None:
    times_ms, points = engine_points(np.array([0.0, 0.5, 1.0]), np.array([[0.0], [1.0], [2.0]]))
    np.testing.assert_allclose(times_ms, [500.0, 1000.0])
    np.testing.assert_allclose(points, [[1.0], [2.0]])


def test_one_segment_becomes_two_of_the_same_cubic() -> None:
    times_ms, points = engine_points(np.array([0.0, 1.0]), np.array([[0.0, 4.0], [1.0, 2.0]]))
    np.testing.assert_allclose(times_ms, [500.0, 1000.0])
    np.testing.assert_allclose(points, [[0.5, 3.0], [1.0, 2.0]])


@given(st.lists(st.sampled_from([0.0, 0.3, 0.3 + 5e-7]), min_size=3, max_size=20))
def test_no_point_is_close_enough_to_be_dropped(positions: list[float]) -> None:
    given_points = np.array([[0.0, 0.0]] + [[value, 0.0] for value in positions])
    times_s = np.arange(len(given_points)) * 0.1
    _, points = engine_points(times_s, given_points)
    sent = np.vstack([given_points[:1], points])
    assert (np.linalg.norm(np.diff(sent, axis=0), axis=1) >= CLOSEST_UNITS).all()
    np.testing.assert_allclose(points, given_points[1:], atol=5e-6)


def test_points_too_dense_in_time_are_rejected_with_figure_and_limit() -> None:
    with pytest.raises(OperationError, match=r"5e-07 ms between .* needs 0.001 ms"):
        check([0], np.array([0.0, 0.1, 0.1000000005]))


def test_more_axes_than_a_spline_has_are_rejected() -> None:
    with pytest.raises(OperationError, match=f"at most {_native.MAX_SPLINE_AXES}"):
        check(range(_native.MAX_SPLINE_AXES + 1), np.array([0.0, 1.0]))


def test_a_pause_is_kept(tmp_path: Path) -> None:
    with running(tmp_path, stream_positions=False) as robot:
        held: list[float] = []
        robot.control_loop.every(500, "test", lambda image: held.append(float(image.position[0])))
        request = goal([0.3, 0.8, 1.1], 0.1, 0.1, 0.2)
        with robot.follower.follow(request) as execution:
            assert execution.wait(30.0)
        planned = execution.trajectory.evaluate(np.linspace(0.0, 1.1, 551))[0][:, 0]
        begin = int(np.flatnonzero(np.array(held) > 1e-6)[0])
        span = min(len(planned) - 1, len(held) - begin)
        late = np.abs(np.array(held[begin : begin + span]) - planned[1 : span + 1])
        assert np.median(late) < 0.01


def test_the_buffer_is_allocated_once_for_the_longest_trajectory(tmp_path: Path) -> None:
    with running(tmp_path, stream_positions=False) as robot:
        watcher = _native.Device()
        watcher.create(_native.SDK_PATH, 5000)
        points = robot.descriptor.trajectory.max_points + 1
        for target in (0.05, 0.0):
            assert watcher.spline_buffer_points(0) == points
            with robot.follower.follow(goal([0.2, 0.4], target / 2, target)) as execution:
                assert execution.wait(30.0)
            assert execution.outcome is Outcome.SUCCEEDED, execution.message
        watcher.close(False)


def test_a_goal_with_as_many_points_as_allowed_needs_no_decimation(tmp_path: Path) -> None:
    with running(tmp_path, stream_positions=False) as robot:
        driver = robot.axes._driver
        assert driver.max_trajectory_points == robot.descriptor.trajectory.max_points + 1
        times_s = np.arange(1, 1501) * 1e-3
        positions = 0.05 * (1.0 - np.cos(np.pi * times_s / times_s[-1]))
        with robot.follower.follow(goal(times_s.tolist(), *positions.tolist())) as execution:
            assert execution.wait(20.0)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message


def test_a_buffer_of_another_program_is_not_taken(tmp_path: Path) -> None:
    device = _native.Device()
    device.create(_native.SDK_PATH, 5000)
    device.set_name("other")
    device.create_spline_buffer(0, 5)
    with (
        pytest.raises(ConnectError, match=r"another program \(other\) has one of 5 points"),
        running(tmp_path, stream_positions=False),
    ):
        pass
    assert device.spline_buffer_points(0) == 5
    device.close(False)


def test_a_small_buffer_that_a_program_has_left_is_replaced(tmp_path: Path) -> None:
    device = _native.Device()
    device.create(_native.SDK_PATH, 5000)
    device.create_spline_buffer(0, 5)
    device.close(True)  # the engine goes on
    with running(tmp_path, stream_positions=False) as robot:
        with robot.follower.follow(goal([0.2, 0.4], 0.05, 0.1)) as execution:
            assert execution.wait(30.0)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
