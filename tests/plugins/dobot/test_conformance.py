"""The backend passes the conformance kit on the stand-in of both generations, in real time."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.features.conformance.runs.kit import KitResult, run_kit

GENERATIONS = {"v4": "robot.yaml", "v3": "robot_v3.yaml"}
DAILY = ("enable", "guiding", "faults")
HERE = Path(__file__).parent


def require_conformance(backend: str, generation: str, *themes: str) -> KitResult:
    checks = [f"test_{theme}.py" for theme in themes]
    outcome = run_kit(backend, *checks, robot=str(HERE / GENERATIONS[generation]))
    assert not outcome.failed, outcome.failed
    assert not outcome.ended_early
    assert len(outcome.passed) > len(outcome.inconclusive)
    return outcome


@pytest.mark.parametrize("generation", GENERATIONS)
def test_it_switches_guides_and_fails_as_the_kit_asks(backend: str, generation: str) -> None:
    assert len(require_conformance(backend, generation, *DAILY).passed) > 15


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("generation", GENERATIONS)
def test_it_passes_the_whole_kit(backend: str, generation: str) -> None:
    assert len(require_conformance(backend, generation).passed) > 80
