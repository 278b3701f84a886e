"""The backend passes the checks that every backend must pass, all of them.

Those of the arm take half a minute more and are run by
``robotd conform --backend canopen --robot tests/canopen/cr3a.yaml``.
"""

from __future__ import annotations

from tests.canopen.conftest import SMALL
from tests.conformance.kit import run_kit


def test_the_simulated_drives_pass() -> None:
    outcome = run_kit("canopen", robot=SMALL)
    assert not outcome.failed
    assert len(outcome.passed) > 90
