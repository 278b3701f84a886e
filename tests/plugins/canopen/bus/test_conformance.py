"""The backend passes the checks that every backend must pass: the first half of the safe order.

The other half is in ``test_conformance_part_two``, a file of its own: files run side by side. Those
of the arm take half a minute more and are run by
``robotd conform --backend canopen --robot tests/plugins/canopen/bus/cr3a.yaml``.
"""

from __future__ import annotations

from tests.features.conformance.runs.kit import run_kit
from tests.plugins.canopen.bus.conftest import SMALL

from robotd_conformance.checks.conftest import SAFE_ORDER

MIDDLE = SAFE_ORDER.index("command_sequences")  # half of the time


def test_the_simulated_drives_pass() -> None:
    outcome = run_kit(
        "canopen", *(f"test_{theme}.py" for theme in SAFE_ORDER[:MIDDLE]), robot=SMALL
    )
    assert not outcome.failed
    assert len(outcome.passed) > 90
