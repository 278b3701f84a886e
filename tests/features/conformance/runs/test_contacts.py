"""The simulation of contacts passes every check. The longest run has a file, and so a worker."""

from __future__ import annotations

import pytest
from tests.features.conformance.runs.kit import OF_THE_DEVICE, run_kit


@pytest.mark.parametrize(("robot", "checks"), [("cr3a", []), ("baymax", OF_THE_DEVICE)])
def test_the_simulation_of_contacts_passes(robot: str, checks: list[str]) -> None:
    outcome = run_kit("mujoco", *checks, robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 90
