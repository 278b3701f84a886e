"""Limits along the path: excursions that the points do not show are found, and named."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.core.motion.helpers import (
    NAMES,
    SETTINGS,
    UNLIMITED,
    at_rest,
    limits,
    peaks_of,
    planned,
    request,
    requests,
    rows,
    states,
    values,
)

from robotd.descriptor import TrajectorySettings
from robotd.motion import (
    JointLimits,
    MotionState,
    RejectionCode,
    TrajectoryRejected,
    TrajectoryRequest,
)
from robotd.motion.extremes import extremes


def rejection(
    asked: TrajectoryRequest,
    joints: JointLimits,
    start: MotionState | None = None,
    settings: TrajectorySettings = SETTINGS,
) -> str:
    with pytest.raises(TrajectoryRejected) as rejected:
        planned(asked, joints, start, settings)
    assert rejected.value.code is RejectionCode.INVALID_GOAL
    return str(rejected.value)


def test_a_point_beyond_a_position_limit() -> None:
    asked = request([2.0, 5.0], [[0, 3.5, 0], [0, 0, 0]], rows(0, 0))
    assert (
        rejection(asked, limits(position=3.0))
        == "joint2 at 2.000 s: position 3.5 rad exceeds 3 rad"
    )


def test_an_excursion_between_points_that_are_all_within_limits() -> None:
    asked = request([1.0, 2.0], [[0, 0, -0.9], [0, 0, -0.9]], [[0, 0, -2.0], [0, 0, 0.0]])
    # Hermite from (-0.9, -2) to (-0.9, 0): lowest after a third of the time, -0.9 - 2·4/27.
    assert rejection(asked, limits(position=1.0)) == (
        "joint3 at 1.333 s: position -1.1963 rad is below -1 rad"
    )


def test_a_plain_move_peaks_at_one_and_a_half_of_its_mean_velocity() -> None:
    assert rejection(request([1.0], [[0, 0, 2.5]]), limits(velocity=3.14)) == (
        "joint3 at 0.500 s: velocity 3.75 rad/s exceeds 3.14 rad/s (+10 % margin)"
    )


def test_velocity_may_use_the_margin_and_no_more() -> None:
    fast = request([1.0], [[0, 0, 2.0 * 1.099]])
    planned(fast, limits(velocity=3.0))
    without = TrajectorySettings(velocity_margin=0.0)
    assert "velocity 3.297 rad/s exceeds 3 rad/s (+0 % margin)" in rejection(
        fast, limits(velocity=3.0), settings=without
    )


def test_every_joint_at_fault_is_named() -> None:
    text = rejection(request([0.1], [[1.0, 0.0, -4.0]]), limits())
    named = [part.split()[0] for part in text.split("; ")]
    assert named == ["joint3", "joint1", "joint3", "joint1", "joint3", "allow"]


def test_a_point_on_the_limit_is_within() -> None:
    planned(request([2.0, 4.0, 6.0], rows(3.0, -3.0, 3.0), rows(0, 0, 0)), limits(velocity=50.0))


def test_a_joint_outside_its_limits_may_come_back_but_go_no_further() -> None:
    outside = at_rest(3.2)
    planned(request([2.0], rows(2.0)), limits(), outside)
    assert "joint1" in rejection(request([2.0], rows(3.3)), limits(), outside)


def test_a_start_that_runs_into_a_limit_is_found() -> None:
    running = MotionState(np.array([2.9, 0.0, 0.0]), np.array([2.0, 0, 0]), np.zeros(3))
    assert "joint1" in rejection(request([1.0], [[2.9, 0, 0]]), limits(), running)


def test_acceleration_within_its_margin_is_noted() -> None:
    trajectory = planned(request([1.0], [[0.9, 1.0, 0]]), limits(acceleration=5.0))
    assert trajectory.notes == ("joint2 at 0.000 s: acceleration 6 rad/s² exceeds 5 rad/s²",)
    assert planned(request([1.0], [[0, 1.0, 0]]), limits(acceleration=6.0)).notes == ()


def test_acceleration_beyond_its_margin_is_rejected_with_what_to_do() -> None:
    asked = request([0.5], [[0, 1.0, 0]])
    assert rejection(asked, limits(velocity=9.0, acceleration=5.0)) == (
        "joint2 at 0.000 s: acceleration 24 rad/s² exceeds 5 rad/s² (+100 % margin); "
        "allow the motion 1.55 times its time"
    )
    planned(request([0.5 * 1.55], [[0, 1.0, 0]]), limits(velocity=9.0, acceleration=5.0))


def test_the_time_that_is_advised_is_enough_for_the_velocity_too() -> None:
    asked = request([0.5], [[0, 1.0, 0]])  # 3 rad/s and 24 rad/s²
    slow = limits(velocity=1.0, acceleration=11.0)
    assert "allow the motion 2.73 times its time" in rejection(asked, slow)
    planned(request([0.5 * 2.73], [[0, 1.0, 0]]), slow)


def test_acceleration_is_only_noted_without_a_margin() -> None:
    settings = TrajectorySettings(acceleration_margin=None)
    trajectory = planned(
        request([0.5], [[0, 1.0, 0]]),
        limits(velocity=9.0, acceleration=5.0),
        settings=settings,
    )
    assert trajectory.notes == ("joint2 at 0.000 s: acceleration 24 rad/s² exceeds 5 rad/s²",)


def test_value_and_limit_differ_in_the_text_by_as_many_digits_as_needed() -> None:
    joints = JointLimits(
        NAMES, np.full(3, -1351774.0), np.full(3, 1351774.0), np.full(3, np.inf), np.full(3, np.inf)
    )
    start = at_rest(-1351774.0)
    assert rejection(request([1.0], [[-1351774.001, -1351774.0, -1351774.0]]), joints, start) == (
        "joint1 at 1.000 s: position -1351774.001 rad is below -1351774 rad"
    )


def test_the_unit_of_a_linear_joint_is_metres() -> None:
    joints = limits(position=0.05)
    object.__setattr__(joints, "units", ("m", "rad", "rad"))
    assert rejection(request([10.0], [[0.06, 0, 0]]), joints) == (
        "joint1 at 10.000 s: position 0.06 m exceeds 0.05 m"
    )


@given(requests(), states())
def test_peaks_bound_the_path_and_are_reached(asked: TrajectoryRequest, start: MotionState) -> None:
    trajectory = planned(asked, UNLIMITED, start)
    position, velocity, acceleration = trajectory.evaluate(
        np.linspace(0.0, trajectory.duration_s, 2001)
    )
    peaks = peaks_of(trajectory)
    for peak, sampled in (
        (peaks.highest, position),
        (peaks.velocity, np.abs(velocity)),
        (peaks.acceleration, np.abs(acceleration)),
    ):
        room = 2e-9 * (1.0 + np.abs(peak.value))
        assert (sampled.max(axis=0) <= peak.value + room).all()
    assert (position.min(axis=0) >= peaks.lowest.value - 1e-8).all()
    reached = trajectory.evaluate(peaks.highest.time_s)[0].diagonal()
    np.testing.assert_allclose(reached, peaks.highest.value, atol=1e-9)


@given(
    st.lists(values(10.0), min_size=1, max_size=6),
    st.floats(0.01, 5.0),
)
def test_extremes_agree_with_the_roots_of_the_derivative(
    coefficients: list[float], width: float
) -> None:
    lowest, highest = extremes(
        np.array([0.0, width]), np.array(coefficients).reshape(1, len(coefficients), 1)
    )
    polynomial = np.poly1d(coefficients)
    roots = np.roots(np.trim_zeros(polynomial.deriv().coef, "f"))
    inside = [r.real for r in roots if abs(r.imag) < 1e-6 and 0.0 <= r.real <= width]
    at_candidates = polynomial(np.array([0.0, width, *inside]))
    room = 1e-7 * (1.0 + np.abs(at_candidates).max())
    assert abs(highest.value[0] - at_candidates.max()) <= room
    assert abs(lowest.value[0] - at_candidates.min()) <= room
    assert abs(polynomial(highest.time_s[0]) - highest.value[0]) <= room
