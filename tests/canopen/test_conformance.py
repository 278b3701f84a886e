"""The backend passes the checks that every backend must pass; these are the ones on motion."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.canopen.conftest import ROBOTS
from tests.conformance.kit import run_kit

CHECKS = (
    "test_enable.py",
    "test_fieldbus.py",
    "test_io.py",
    "test_refusals.py",
    "test_stopping.py",
)


@pytest.mark.timeout(200)
def test_the_simulated_drives_pass(tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    base = ROBOTS / "cr3a" / "robot.yaml"
    robot.write_text(
        f"extends: {base}\nname: cr3a_canopen\ndefault_variant: canopen_simulated\n",
        encoding="utf-8",
    )
    outcome = run_kit("canopen", *CHECKS, robot=str(robot))
    assert not outcome.failed
    assert len(outcome.passed) > 30
