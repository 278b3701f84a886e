"""The backend passes checks of the kit in the gate; the others take minutes.

All of them: ``robotd conform --backend ethercat --robot tests/ethercat/three_drives.yaml``.
"""

from __future__ import annotations

from tests.conformance.kit import run_kit
from tests.ethercat.robot import SMALL

CHECKS = ("test_stopping.py", "test_switches.py", "test_io.py")


def test_the_simulated_slaves_pass() -> None:
    outcome = run_kit("ethercat", *CHECKS, robot=SMALL)
    assert not outcome.failed
    assert len(outcome.passed) > 15
