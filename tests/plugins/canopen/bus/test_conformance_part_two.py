"""The backend passes the checks that every backend must pass: the second half."""

from __future__ import annotations

from tests.features.conformance.runs.kit import run_kit
from tests.plugins.canopen.bus.conftest import SMALL
from tests.plugins.canopen.bus.test_conformance import MIDDLE

from robotd_conformance.checks.conftest import SAFE_ORDER


def test_the_simulated_drives_pass() -> None:
    outcome = run_kit(
        "canopen", *(f"test_{theme}.py" for theme in SAFE_ORDER[MIDDLE:]), robot=SMALL
    )
    assert not outcome.failed
    assert len(outcome.passed) > 90
