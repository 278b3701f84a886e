"""The report of the conformance checks: counts, share, reasons, and what failed."""

from __future__ import annotations

from typing import Any, Literal

import pytest

from robotd_conformance.checks.inconclusive import UNDECIDED
from robotd_conformance.checks.kit_report import KitReport
from robotd_conformance.checks.kit_target import KitTarget

Phase = Literal["setup", "call", "teardown"]
Outcome = Literal["passed", "failed", "skipped"]


def told(name: str, when: Phase, outcome: Outcome, why: str = "no bench") -> Any:
    nodeid, place = f"some/where/test_units.py::{name}", ("file", 1, name)
    reason = ("file", 1, f"Skipped: {why}") if outcome == "skipped" else None
    report = pytest.TestReport(nodeid, place, {}, outcome, reason, when)
    report.user_properties = [("capability", "axes"), ("clauses", "AxisDriver.read/fills")]
    return report


def lines(*reports: Any) -> list[str]:
    report = KitReport(KitTarget("sim", None))
    for reported in reports:
        report.pytest_runtest_logreport(reported)
    return list(report.lines())


def test_a_check_counts_once_and_failures_are_named() -> None:
    found = lines(
        told("test_a", "setup", "passed"),
        told("test_a", "call", "passed"),
        told("test_b", "call", "failed"),
        told("test_c", "setup", "skipped"),
        told("test_d", "call", "skipped", f"{UNDECIDED}; seen: 3 rad"),
    )
    assert found[1].split() == ["axes", "1", "1", "1", "1"]
    assert found[3:] == [
        "tested on 50% of the checks: 2 of 4",
        "duration: 0 s",
        "  1 skipped: no bench",
        f"INCONCLUSIVE test_units.py::test_d: {UNDECIDED}; seen: 3 rad",
        "FAILED test_units.py::test_b",
        "  AxisDriver.read/fills: Fill every array of ``image`` in place, and ``fresh_ns``.",
        "verdict: FAILED, 1 of 2",
    ]


def test_a_failure_while_cleaning_up_is_a_failure() -> None:
    found = lines(told("test_a", "call", "passed"), told("test_a", "teardown", "failed"))
    assert found[-3:] == [
        "FAILED test_units.py::test_a",
        "  AxisDriver.read/fills: Fill every array of ``image`` in place, and ``fresh_ns``.",
        "verdict: FAILED, 1 of 1",
    ]


@pytest.mark.parametrize(
    ("outcome", "verdict"), [("passed", "passed"), ("skipped", "nothing was tested")]
)
def test_who_declares_nothing_has_not_passed(outcome: Outcome, verdict: str) -> None:
    assert lines(told("test_a", "call", outcome))[-1] == f"verdict: {verdict}"


def test_a_failure_names_faults_that_the_check_has_found() -> None:
    found = lines(told("test_a_commanded_radian_is_a_measured_radian[x]", "call", "failed"))
    (faults,) = (line for line in found if "faults that it has found" in line)
    assert "degrees" in faults
