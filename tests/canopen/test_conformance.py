"""The backend passes the checks that every backend must pass; these are the ones on motion."""

from __future__ import annotations

from tests.canopen.conftest import SMALL
from tests.conformance.kit import run_kit

CHECKS = (
    "test_enable.py",
    "test_fieldbus.py",
    "test_io.py",
    "test_refusals.py",
    "test_stopping.py",
)


def test_the_simulated_drives_pass() -> None:
    outcome = run_kit("canopen", *CHECKS, robot=SMALL)
    assert not outcome.failed
    assert len(outcome.passed) > 30
