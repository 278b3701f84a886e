"""The conformance checks, run inside a test."""

from __future__ import annotations

import gc
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import robotd_conformance.checks as package
from robotd_conformance.checks.conftest import MISPLACED, SAFE_ORDER
from robotd_conformance.checks.inconclusive import is_refused, is_undecided

CHECKS = Path(package.__file__).parent
_OF_THE_PROCESS = {"cost", "device_under_load", "leaks", "locks", "process", "threads"}
OF_THE_DEVICE = [f"test_{theme}.py" for theme in SAFE_ORDER if theme not in _OF_THE_PROCESS]
"""Files of the checks that another kind of robot may fail, and not of those of the process."""


@dataclass
class KitResult:
    """Names of checks (``test_units.py::test_…``) by how they went, and what failures said.

    Attributes:
        inconclusive: checks that no attempt could judge, and what was seen.
        refused: checks that would have led an axis out of its room, and how.
        reasons: why checks were left out.
        ended_early: the run has ended before its last check.
    """

    passed: set[str] = field(default_factory=set)
    skipped: set[str] = field(default_factory=set)
    failed: dict[str, str] = field(default_factory=dict)
    inconclusive: dict[str, str] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    ended_early: bool = False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        name = report.nodeid.rpartition("/")[2]
        if report.failed:
            self.failed[name] = str(report.longrepr)
        elif is_undecided(report):
            self.inconclusive[name] = str(report.longrepr)
        elif is_refused(report):
            self.refused[name] = str(report.longrepr)
        elif report.skipped:
            self.skipped.add(name)
            self.reasons[name] = str(report.longrepr)
        elif report.when == "call":
            self.passed.add(name)


def run_kit(
    backend: str, *checks: str, robot: str | None = None, options: Sequence[str] = ()
) -> KitResult:
    """Run ``checks`` (all of them without a name) on ``backend``, within this process."""
    outcome = KitResult()
    arguments = [f"--robotd-backend={backend}", *options]
    if robot:
        arguments.append(f"--robotd-robot={robot}")
    gc.freeze()  # a run collects garbage at its end, twice: all of this process takes 0.1 s
    try:
        status = pytest.main(
            [
                *([str(CHECKS / check) for check in checks] or [str(CHECKS)]),
                *arguments,
                f"--rootdir={CHECKS}",
                "--config-file=/dev/null",
                "--import-mode=importlib",
                "-qq",
                "-pno:cacheprovider",
                "-Werror",
            ],
            plugins=[outcome],
        )
    finally:
        gc.unfreeze()
    outcome.ended_early = status in (pytest.ExitCode.INTERRUPTED, MISPLACED)
    return outcome
