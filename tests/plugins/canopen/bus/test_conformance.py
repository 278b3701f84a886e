"""The backend passes the checks that every backend must pass, all of them.

Those of the arm take half a minute more and are run by
``robotd conform --backend canopen --robot tests/plugins/canopen/bus/cr3a.yaml``.
"""

from __future__ import annotations

from tests.features.conformance.runs.kit import run_kit
from tests.plugins.canopen.bus.conftest import SMALL


def test_the_simulated_drives_pass() -> None:
    outcome = run_kit("canopen", robot=SMALL)
    assert not outcome.failed
    assert len(outcome.passed) > 90
