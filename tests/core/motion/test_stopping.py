"""A stop along the path: monotone, within the limits, at rest at its end."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.motion.helpers import UNLIMITED, limits, peaks_of, planned, request, requests, rows

from robotd.arrays import FloatArray
from robotd.motion import StopPlan, Trajectory, TrajectoryRequest, plan_stop

PERIOD_S = 0.001


def gentle(acceleration: float) -> Trajectory:
    """A move back and forth whose own acceleration stays within ``acceleration``."""
    times = np.linspace(0.25, 8.0, 32)
    phase = np.outer(times, [1.0, 1.7, 0.4])
    fade = np.sin(np.pi * times / 8.0)[:, None] ** 2
    trajectory = planned(request(times, 0.8 * fade * np.sin(phase)))
    assert (peaks_of(trajectory).acceleration.value <= acceleration).all()
    return trajectory


def duration_of(stop: StopPlan) -> float:
    """Duration of the whole stop."""
    stop.at(np.inf)
    return stop._elapsed_s[-1]


def rest_of(trajectory: Trajectory, stop: StopPlan) -> FloatArray:
    """Positions at standstill."""
    return trajectory.state_at(stop.at(np.inf)[0]).position


def followed(
    trajectory: Trajectory, stop: StopPlan
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
    """Joint positions at fixed periods through the stop and a little longer, and the rates."""
    elapsed = np.arange(0.0, duration_of(stop) + 3 * PERIOD_S, PERIOD_S)
    ramp = [stop.at(time_s) for time_s in elapsed]
    return trajectory.evaluate(np.array([time_s for time_s, _, _ in ramp])), np.array(ramp)


@given(st.floats(0.0, 8.0))
def test_every_joint_stays_within_its_acceleration(from_s: float) -> None:
    joints = limits(acceleration=4.0)
    trajectory = gentle(4.0)
    stop = plan_stop(trajectory, from_s, joints)
    (_, velocity, acceleration), ramp = followed(trajectory, stop)
    felt = acceleration * ramp[:, 1:2] ** 2 - velocity * ramp[:, 2:3]
    assert np.abs(felt).max() <= 4.0 * 1.02


@given(requests(), st.floats(0.0, 1.0), st.sampled_from([0.5, 5.0, 50.0, np.inf]))
def test_any_trajectory_stops_on_its_path(
    asked: TrajectoryRequest, share: float, acceleration: float
) -> None:
    trajectory = planned(asked)
    from_s = share * trajectory.duration_s
    stop = plan_stop(trajectory, from_s, limits(acceleration=acceleration))
    _, ramp = followed(trajectory, stop)
    times, rates, slopes = ramp.T
    assert np.isfinite(ramp).all()
    assert (np.diff(times) >= -1e-12).all()
    assert (np.diff(rates) <= 1e-12).all()
    assert (slopes >= 0.0).all()
    assert rates[-1] == 0.0
    assert from_s <= times[-1] == stop.at(np.inf)[0] <= trajectory.duration_s


@given(requests(), st.floats(0.0, 1.0))
def test_the_rate_is_the_derivative_of_the_time(asked: TrajectoryRequest, share: float) -> None:
    trajectory = planned(asked)
    stop = plan_stop(trajectory, share * trajectory.duration_s, limits(acceleration=2.0))
    times = [stop.at(time_s) for time_s in np.linspace(0.0, duration_of(stop), 200)]
    step = duration_of(stop) / 199
    for (before, rate, slope), (after, next_rate, _) in pairwise(times[:-1]):
        assert next_rate * step - 1e-9 <= after - before <= rate * step + 1e-9
        assert slope <= 1e3


def test_a_stop_in_full_speed_is_as_short_as_the_acceleration_allows() -> None:
    cruise = planned(
        request(
            [1.0, 9.0, 10.0], [[1, 0, 0], [17, 0, 0], [18, 0, 0]], [[2, 0, 0], [2, 0, 0], [0, 0, 0]]
        )
    )
    stop = plan_stop(cruise, 5.0, limits(acceleration=4.0))
    assert duration_of(stop) == pytest.approx(2.0 / 4.0, rel=1e-3)
    distance = rest_of(cruise, stop) - cruise.state_at(5.0).position
    assert distance[0] == pytest.approx(2.0**2 / (2 * 4.0), rel=1e-3)
    assert distance[1] == 0.0


def test_a_joint_that_brakes_at_its_limit_already_is_not_asked_for_more() -> None:
    trajectory = planned(request([1.0], [[1.0, 0.0, 0.0]]))  # brakes with 6 rad/s² at its end
    stop = plan_stop(trajectory, 0.95, limits(acceleration=6.0))
    (_, velocity, acceleration), ramp = followed(trajectory, stop)
    felt = acceleration * ramp[:, 1:2] ** 2 - velocity * ramp[:, 2:3]
    assert np.abs(felt).max() <= 6.0 * 1.02


def test_a_plan_that_brakes_beyond_the_limit_still_stops_early() -> None:
    times = np.arange(1, 101) * 0.1
    rough = 0.2 * (np.arange(100) % 2)[:, None] * np.array([1.0, 0.5, 0.0])
    trajectory = planned(request(times, rough))
    assert peaks_of(trajectory).acceleration.value.max() > 50.0
    assert duration_of(plan_stop(trajectory, 1.03, limits(acceleration=10.0))) < 1.0


def test_a_stop_is_planned_as_far_as_it_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    trajectory = gentle(4.0)
    evaluated: list[int] = []
    evaluate = Trajectory.evaluate

    def counted(self: Trajectory, times_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        evaluated.append(len(times_s))
        return evaluate(self, times_s)

    monkeypatch.setattr(Trajectory, "evaluate", counted)
    stop = plan_stop(trajectory, 4.0, limits(acceleration=0.2))
    stop.at(0.002)
    assert sum(evaluated) < 25  # of the control period in which the stop begins
    assert duration_of(stop) > 1.0
    assert sum(evaluated) > 500


def test_standstill_stops_at_once() -> None:
    trajectory = planned(request([1.0, 5.0, 6.0], rows(0.5, 0.5, 1.0), rows(0, 0, 0)))
    stop = plan_stop(trajectory, 3.0, limits())
    assert duration_of(stop) <= 0.002
    np.testing.assert_allclose(
        rest_of(trajectory, stop), trajectory.state_at(3.0).position, atol=1e-12
    )


def test_a_stop_after_the_end_has_nothing_to_do() -> None:
    trajectory = planned(request([1.0], rows(0.5)))
    stop = plan_stop(trajectory, 7.0, UNLIMITED)
    assert duration_of(stop) == 0.0
    assert stop.at(0.0) == (1.0, 0.0, 0.0)
    np.testing.assert_array_equal(rest_of(trajectory, stop), 0.5)


def test_before_a_stop_time_runs_at_rate_one() -> None:
    trajectory = planned(request([1.0], rows(0.5)))
    time_s, rate, slope = plan_stop(trajectory, 0.5, limits()).at(-0.1)
    assert time_s == pytest.approx(0.4)
    assert (rate, slope) == (1.0, 0.0)
