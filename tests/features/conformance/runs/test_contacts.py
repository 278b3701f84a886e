"""The simulation of contacts passes the checks of motion; `robotd conform` runs all."""

from __future__ import annotations

import pytest
from tests.features.conformance.runs.kit import run_kit

CHECKS = (
    "test_enable.py",
    "test_faults.py",
    "test_feedback.py",
    "test_io.py",
    "test_profiles.py",
    "test_setpoints.py",
    "test_stopping.py",
    "test_streams.py",
    "test_trajectories.py",
    "test_units.py",
)


@pytest.mark.parametrize("robot", ["cr3a", "baymax"])
def test_the_simulation_of_contacts_passes(robot: str) -> None:
    outcome = run_kit("mujoco", *CHECKS, robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 60
