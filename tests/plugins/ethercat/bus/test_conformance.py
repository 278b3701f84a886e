"""The backend passes checks of the kit in the gate; the others take minutes.

All of them:
``robotd conform --backend ethercat --robot tests/plugins/ethercat/bus/three_drives.yaml``.
"""

from __future__ import annotations

from tests.features.conformance.runs.kit import run_kit
from tests.plugins.ethercat.bus.robot import SMALL

CHECKS = ("test_stopping.py", "test_switches.py", "test_io.py", "test_silences.py")


def test_the_simulated_slaves_pass() -> None:
    outcome = run_kit("ethercat", *CHECKS, robot=SMALL)
    assert not outcome.failed
    assert len(outcome.passed) > 15
