"""The backend passes the checks of the kit that depend on its bus; the others take as long again.

All of them: ``robotd conform --backend canopen --robot three_drives.yaml`` in this folder, and with
``cr3a.yaml`` those of the arm.
"""

from __future__ import annotations

from pathlib import Path

from tests.features.conformance.runs.kit import run_kit
from tests.plugins.canopen.bus.conftest import SMALL

CHECKS = (
    "fieldbus", "io", "switches", "enable", "connection", "ageing", "stopping", "faults",
    "watchdog", "axes_apart", "units", "overrides", "shown_motion", "velocity_commands",
    "streams", "setpoints", "underrun", "trajectories", "bus_objects", "lost_nodes", "torque",
    "scaling", "reopening", "silences", "threads",
)  # fmt: skip


def test_the_simulated_drives_pass() -> None:
    outcome = run_kit("canopen", *(f"test_{theme}.py" for theme in CHECKS), robot=SMALL)
    assert not outcome.failed
    assert len(outcome.passed) > 90


def test_drives_that_are_guided_by_hand_pass() -> None:
    robot = str(Path(__file__).parent / "guided_drives.yaml")
    outcome = run_kit("canopen", "test_guiding.py", robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 4
