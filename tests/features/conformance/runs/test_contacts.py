"""The simulation of contacts passes every check. The longest run has a file, and so a worker."""

from __future__ import annotations

import pytest
from tests.features.conformance.runs.kit import run_kit


@pytest.mark.parametrize("robot", ["cr3a", "baymax"])
def test_the_simulation_of_contacts_passes(robot: str) -> None:
    outcome = run_kit("mujoco", robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 90
