"""The backends of this repository pass every check."""

from __future__ import annotations

import pytest
from tests.conformance.kit import CHECKS, run_kit


@pytest.mark.parametrize("robot", [None, "cr3a", "standalone", "baymax"])
def test_the_simulation_passes(robot: str | None) -> None:
    outcome = run_kit("sim", robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 90


def test_every_theme_is_there() -> None:
    themes = {path.stem for path in CHECKS.glob("test_*.py")}
    assert len(themes) == 14
