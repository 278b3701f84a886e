"""An offset from a path fades away smoothly, and within the limits of the joints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.motion import JointLimits, Rejoin
from robotd.motion.rejoin import SHORTEST_S, VELOCITY_SHARE

LIMITS = JointLimits(
    names=("a", "b"),
    lower=np.array([-3.0, -np.inf]),
    upper=np.array([3.0, np.inf]),
    velocity=np.array([3.0, 1.0]),
    acceleration=np.array([12.0, 5.0]),
)
offsets = st.lists(st.floats(-0.5, 0.5), min_size=4, max_size=4).map(
    lambda values: np.array(values).reshape(2, 2)
)


@given(offsets)
def test_it_begins_as_given_and_ends_at_rest_on_the_path(offset: np.ndarray) -> None:
    rejoin = Rejoin(offset, LIMITS)
    np.testing.assert_allclose(rejoin.at(0.0), offset, atol=1e-12)
    np.testing.assert_allclose(rejoin.at(rejoin.duration_s * (1 - 1e-9)), 0.0, atol=1e-6)
    assert not rejoin.at(rejoin.duration_s).any()


@given(offsets)
def test_the_velocity_is_the_slope_and_the_limits_are_respected(offset: np.ndarray) -> None:
    rejoin = Rejoin(offset, LIMITS)
    times_s = np.linspace(0.0, rejoin.duration_s, 2001)
    position, velocity = np.stack([rejoin.at(time_s) for time_s in times_s], axis=1)
    slope = np.gradient(position, times_s, axis=0)[1:-1]
    assert np.abs(slope - velocity[1:-1]).max() < 1e-3
    # An offset in position and one in velocity may add up.
    allowed = 1.001 * (np.abs(offset[1]) + VELOCITY_SHARE * LIMITS.velocity)
    assert (np.abs(velocity).max(axis=0) <= allowed).all()
    acceleration = np.abs(np.gradient(velocity, times_s, axis=0)).max(axis=0)
    assert (acceleration <= 2.01 * LIMITS.acceleration).all()


def test_without_limits_it_takes_its_shortest_time() -> None:
    free = JointLimits(("a",), *(np.array([end]) for end in (-np.inf, np.inf, np.inf, np.inf)))
    assert Rejoin(np.array([[0.1], [0.2]]), free).duration_s == pytest.approx(SHORTEST_S)
