"""Setpoints that a device holds ahead: expected late, and a bridged gap is not an underrun."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.control.loop.stall_recovery import StallRecovery
from robotd.motion import JointLimits

PERIOD_NS = 2_000_000
BUFFER_S = 0.01
SPEED = 0.5
LIMITS = JointLimits(("a",), *(np.array([value]) for value in (-3.0, 3.0, 3.0, 10.0)))


def path(time_ns: int) -> np.ndarray:
    return np.array([[SPEED * time_ns * 1e-9], [SPEED]])


@pytest.fixture
def recovery() -> StallRecovery:
    """On its path since 0.1 s."""
    recovery = StallRecovery(path(0) * 0.0, 0, LIMITS, 0.0, BUFFER_S)
    for due_ns in range(PERIOD_NS, 100_000_001, PERIOD_NS):
        setpoint = path(due_ns)
        assert not recovery.correct(setpoint, due_ns, PERIOD_NS * 1e-9)
        recovery.sent(setpoint, due_ns)
    return recovery


def test_a_setpoint_is_expected_after_the_buffer(recovery: StallRecovery) -> None:
    expected = np.zeros((2, 1))
    recovery.expect(100_000_000, expected)
    np.testing.assert_allclose(expected, path(90_000_000))


def test_a_gap_that_the_buffer_bridges_is_no_underrun(recovery: StallRecovery) -> None:
    due_ns = 100_000_000 + round(BUFFER_S * 1e9) + PERIOD_NS
    setpoint = path(due_ns)
    assert not recovery.correct(setpoint, due_ns, PERIOD_NS * 1e-9)
    np.testing.assert_allclose(setpoint, path(due_ns))


def test_after_a_longer_gap_the_axes_rest_at_the_last_setpoint(recovery: StallRecovery) -> None:
    due_ns = 100_000_000 + round(BUFFER_S * 1e9) + 3 * PERIOD_NS
    setpoint = path(due_ns)
    assert recovery.correct(setpoint, due_ns, PERIOD_NS * 1e-9)
    np.testing.assert_allclose(setpoint, [[SPEED * 0.1], [0.0]])


def test_before_the_first_setpoint_no_buffer_bridges_a_gap() -> None:
    recovery = StallRecovery(path(0) * 0.0, 0, LIMITS, 0.0, BUFFER_S)
    due_ns = round(BUFFER_S * 1e9)
    setpoint = path(due_ns)
    assert recovery.correct(setpoint, due_ns, PERIOD_NS * 1e-9)
    np.testing.assert_allclose(setpoint, 0.0)
