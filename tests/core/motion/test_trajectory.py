"""The path between the knots, and reading it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly, CubicHermiteSpline, CubicSpline, PPoly
from tests.core.motion.helpers import planned, request, requests, rows, states

from robotd.motion import Interpolation, MotionState, Sampler, TrajectoryRejected, TrajectoryRequest

TIMES = np.array([0.5, 1.0, 1.8, 2.0])
POSITIONS = np.array([[0.1, -0.2, 0.3], [0.4, 0.0, 0.1], [1.0, 0.2, -0.5], [1.1, 0.3, -0.4]])
VELOCITIES = np.array([[0.5, 0.1, 0.2], [0.6, 0.3, -0.4], [0.1, 0.1, 0.3], [0.0, 0.0, 0.0]])
ACCELERATIONS = np.array([[1, 2, 3], [-1, 0, 1], [0.5, -2, 1], [-1, 1, 2]], float)

WITH_START = (np.r_[0.0, TIMES], np.vstack([np.zeros(3), POSITIONS]))


def reference(kind: Interpolation) -> CubicSpline | CubicHermiteSpline | BPoly:
    times, positions = WITH_START
    velocities = np.vstack([np.zeros(3), VELOCITIES])
    accelerations = np.vstack([np.zeros(3), ACCELERATIONS])
    if kind is Interpolation.CUBIC_SPLINE:
        return CubicSpline(times, positions, bc_type="clamped")
    if kind is Interpolation.CUBIC_HERMITE:
        return CubicHermiteSpline(times, positions, velocities)
    return BPoly.from_derivatives(
        times, list(np.stack([positions, velocities, accelerations], axis=1))
    )


@pytest.mark.parametrize(
    ("asked", "kind"),
    [
        (request(TIMES, POSITIONS), Interpolation.CUBIC_SPLINE),
        (request(TIMES, POSITIONS, VELOCITIES), Interpolation.CUBIC_HERMITE),
        (request(TIMES, POSITIONS, VELOCITIES, ACCELERATIONS), Interpolation.QUINTIC_HERMITE),
    ],
)
def test_the_path_is_the_one_that_scipy_makes_of_what_is_given(
    asked: TrajectoryRequest, kind: Interpolation
) -> None:
    trajectory = planned(asked)
    assert trajectory.kind is kind
    times = np.linspace(0.0, 1.999, 401)
    curve = reference(kind)
    for order, ours in enumerate(trajectory.evaluate(times)):
        np.testing.assert_allclose(
            ours, curve.derivative(order)(times) if order else curve(times), atol=1e-9
        )


@given(requests(), states())
def test_every_knot_is_hit_exactly(asked: TrajectoryRequest, start: MotionState) -> None:
    trajectory = planned(asked, start=start)
    position, velocity, _ = trajectory.evaluate(trajectory.breaks)
    dropped = len(asked.times_s) + 1 - len(trajectory.breaks)  # a first point at the start
    np.testing.assert_array_equal(position[1:], asked.positions[dropped:])
    if asked.velocities is not None:
        np.testing.assert_array_equal(velocity[1:], asked.velocities[dropped:])
    np.testing.assert_array_equal(velocity[-1], 0.0)
    assert trajectory.duration_s == asked.times_s[-1]
    np.testing.assert_array_equal(trajectory.knot_positions, position)


@given(requests(), states())
def test_position_and_velocity_are_continuous_at_the_knots(
    asked: TrajectoryRequest, start: MotionState
) -> None:
    trajectory = planned(asked, start=start)
    widths = np.diff(trajectory.breaks)
    for segment, width in enumerate(widths):
        end = [np.polyval(trajectory.coefficients[segment, :, j], width) for j in range(3)]
        speed = [
            np.polyval(np.polyder(trajectory.coefficients[segment, :, j]), width) for j in range(3)
        ]
        following = trajectory.state_at(trajectory.breaks[segment + 1])
        scale = 1.0 + np.abs(trajectory.coefficients[segment]).max()
        np.testing.assert_allclose(end, following.position, atol=1e-12 * scale)
        np.testing.assert_allclose(speed, following.velocity, atol=1e-11 * scale)


@given(requests(), states(), st.lists(st.floats(-0.5, 9.0), min_size=1, max_size=20))
def test_the_sampler_gives_what_scipy_gives_in_any_order_of_times(
    asked: TrajectoryRequest, start: MotionState, times: list[float]
) -> None:
    trajectory = planned(asked, start=start)
    curve = PPoly(trajectory.coefficients.transpose(1, 0, 2), trajectory.breaks)
    sampler = Sampler(trajectory)
    for time_s in times:
        position, velocity, acceleration = out = np.full((3, 3), np.nan)
        sampler.sample(time_s, out)
        if time_s >= trajectory.duration_s:
            np.testing.assert_array_equal(position, trajectory.final_position)
            assert not velocity.any()
            assert not acceleration.any()
            continue
        within = max(time_s, 0.0)
        scale = 1.0 + np.abs(trajectory.coefficients).max()
        np.testing.assert_allclose(position, curve(within), atol=1e-13 * scale)
        np.testing.assert_allclose(velocity, curve(within, 1), atol=1e-12 * scale)
        np.testing.assert_allclose(acceleration, curve(within, 2), atol=1e-11 * scale)


@settings(max_examples=20)
@given(requests(), states())
def test_state_and_samples_agree(asked: TrajectoryRequest, start: MotionState) -> None:
    trajectory = planned(asked, start=start)
    sampler = Sampler(trajectory)
    position, velocity, acceleration = out = np.zeros((3, 3))
    for time_s in np.arange(0.0, trajectory.duration_s + 0.1, 0.05):
        sampler.sample(time_s, out)
        state = trajectory.state_at(time_s)
        np.testing.assert_allclose(position, state.position, atol=1e-9)
        np.testing.assert_allclose(velocity, state.velocity, atol=1e-8)
        np.testing.assert_allclose(acceleration, state.acceleration, atol=1e-7)


def test_a_sample_goes_into_parts_of_larger_arrays_too() -> None:
    trajectory = planned(request([1.0], rows(1.0)))
    image = np.full((3, 8), np.nan)
    Sampler(trajectory).sample(0.5, image[:, ::2][:, :3])
    np.testing.assert_allclose(image[0, [0, 2, 4]], 0.5)


def test_a_trajectory_cannot_be_changed() -> None:
    trajectory = planned(request([1.0], rows(1.0)))
    with pytest.raises(ValueError, match="read-only"):
        trajectory.coefficients[0, 0, 0] = 1.0


def test_numbers_that_cannot_be_joined_are_rejected() -> None:
    with pytest.raises(TrajectoryRejected, match="too far apart"):
        planned(request([0.001, 0.002], rows(1e308, -1e308), rows(0, 0), rows(0, 0)))
    with pytest.raises(TrajectoryRejected, match="too far apart"):
        planned(request([2.0], rows(1e308)))
