"""The backend passes checks of the kit in the gate; the others take minutes.

All of them:
``robotd conform --backend ethercat --robot tests/plugins/ethercat/bus/three_drives.yaml``.
"""

from __future__ import annotations

from pathlib import Path

from tests.features.conformance.runs.kit import run_kit
from tests.plugins.ethercat.bus.robot import SMALL

CHECKS = ("test_stopping.py", "test_switches.py", "test_io.py", "test_silences.py")


def test_the_simulated_slaves_pass() -> None:
    outcome = run_kit("ethercat", *CHECKS, robot=SMALL)
    assert not outcome.failed
    assert len(outcome.passed) > 15


def test_slaves_that_are_guided_by_hand_pass() -> None:
    robot = str(Path(__file__).parent / "guided_drives.yaml")
    outcome = run_kit("ethercat", "test_guiding.py", robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 4
