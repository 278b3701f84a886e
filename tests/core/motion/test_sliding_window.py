"""Reference through windows of points: averages, replacement, and times beyond the points."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.motion.sliding_window import WIDTH_S, SlidingWindow

PERIOD_S = 0.002


def window(times_s: FloatArray, velocity: float = 0.3) -> SlidingWindow:
    """One joint at a constant velocity."""
    return SlidingWindow(*points(times_s, velocity))


def points(times_s: FloatArray, velocity: float = 0.3) -> tuple[list[int], FloatArray, FloatArray]:
    times_ns = [round(time_s * NANOSECONDS) for time_s in times_s]
    return times_ns, velocity * times_s[:, None], np.full((len(times_s), 1), velocity)


def sampled(curve: SlidingWindow, begin_s: float, end_s: float) -> FloatArray:
    times_s = np.arange(begin_s, end_s, PERIOD_S)
    return np.array([curve.at(round(time_s * NANOSECONDS))[:, 0] for time_s in times_s])


@pytest.mark.parametrize("time_s", [0.0, 0.1, 0.15, 0.199, 0.3])
def test_a_straight_line_stays_one_before_within_and_after_its_points(time_s: float) -> None:
    state = window(np.arange(0.1, 0.2, 0.01)).at(round(time_s * NANOSECONDS))[:, 0]
    assert state == pytest.approx([0.3 * time_s, 0.3, 0.0], abs=1e-9)


def test_one_point_goes_on_with_its_velocity() -> None:
    state = window(np.array([0.1])).at(NANOSECONDS // 5)[:, 0]
    assert state == pytest.approx([0.06, 0.3, 0.0], abs=1e-9)


def test_a_step_of_the_velocity_takes_two_widths_and_is_consistent() -> None:
    times_s = np.arange(0.0, 1.0, 0.01)
    position = 0.3 * np.minimum(times_s, 0.5)[:, None]
    velocity = np.where(times_s < 0.5, 0.3, 0.0)[:, None]
    curve = SlidingWindow([round(time_s * NANOSECONDS) for time_s in times_s], position, velocity)
    states = sampled(curve, 0.3, 0.7)
    deviation = states[:, 0] - 0.3 * np.minimum(np.arange(0.3, 0.7, PERIOD_S), 0.5)
    assert np.abs(deviation).max() < 0.3 * WIDTH_S / 5
    assert np.abs(states[:, 2]).max() <= 0.3 / WIDTH_S * 1.1
    assert np.diff(states[:, 0]) / PERIOD_S == pytest.approx(
        (states[1:, 1] + states[:-1, 1]) / 2, abs=1e-3
    )
    assert np.diff(states[:, 1]) / PERIOD_S == pytest.approx(
        (states[1:, 2] + states[:-1, 2]) / 2, abs=0.1
    )
    assert curve.rests == [True]


def test_a_window_replaces_the_rest_of_the_one_before_from_its_first_point_on() -> None:
    curve = window(np.arange(0.0, 0.3, 0.01))
    before = curve.at(NANOSECONDS // 10)
    times_ns, position, velocity = points(np.arange(0.2, 0.4, 0.01))
    curve.replace(times_ns, position + 0.1, velocity)
    assert curve.at(NANOSECONDS // 10) == pytest.approx(before, abs=1e-9)  # 0.1 s before
    assert curve.at(3 * NANOSECONDS // 10)[0, 0] == pytest.approx(0.19, abs=1e-9)
    assert curve.newest == pytest.approx([0.3 * 0.39 + 0.1])


def test_points_of_the_past_do_not_pile_up() -> None:
    curve = window(np.arange(0.0, 0.2, 0.01))
    for begin_s in np.arange(0.01, 5.0, 0.01):
        curve.replace(*points(np.arange(begin_s, begin_s + 0.195, 0.01)))
    assert len(curve._times_ns) <= 31
    assert curve.at(round(5.1 * NANOSECONDS))[:, 0] == pytest.approx([1.53, 0.3, 0.0], abs=1e-8)


def test_times_of_a_jittering_client_hardly_reach_the_velocity() -> None:
    late = np.random.default_rng(3).uniform(0.0, 0.003, 250)
    times_s = np.arange(250) * 0.004 + late
    position = 0.3 * 0.004 * np.arange(250)[:, None]
    velocity = np.gradient(position[:, 0], times_s)[:, None]
    curve = SlidingWindow([round(time_s * NANOSECONDS) for time_s in times_s], position, velocity)
    assert velocity.max() > 0.5
    states = sampled(curve, 0.1, 0.9)
    assert states[:, 1] == pytest.approx(0.3, rel=0.1)
    assert np.abs(states[:, 2]).max() < 2.0


def test_the_way_back_to_the_reference_is_a_little_faster_than_the_points() -> None:
    curve, limit = window(np.arange(0.0, 0.2, 0.01)), np.array([3.0])
    reference = curve.at(NANOSECONDS // 10)
    near = curve.velocity_range(reference, reference[0] - 0.01, limit)
    assert near == ([pytest.approx(-0.035)], [pytest.approx(0.345)])
    on = curve.velocity_range(reference, reference[0], limit)
    assert on == ([pytest.approx(-0.015)], [pytest.approx(0.345)])
    far = curve.velocity_range(reference, reference[0] + 5.0, limit)
    assert far == ([-3.0], [3.0])
