"""Faults that checks are known to find, and the quick choice: as measured by the mutants."""

from __future__ import annotations

import pytest
from tests.features.conformance.runs.kit import CHECKS, run_kit
from tests.features.conformance.runs.measured_faults import checks_of, found_faults
from tests.features.conformance.runs.mutants import all_mutants
from tests.features.conformance.runs.mutants.later import LaterMutant

from robotd_conformance.checks import known_faults

RENEW = "python -m tests.features.conformance.runs.measured_faults"


def test_they_are_those_of_the_mutants() -> None:
    assert known_faults._content()["found"] == found_faults(), RENEW


def test_quick_checks_exist_and_find_most_mutants() -> None:
    quick = known_faults.quick_checks()
    for check in quick:
        theme, _, name = check.partition("::")
        assert f"def {name}(" in (CHECKS / theme).read_text(encoding="utf-8"), check
    mutants = [mutant for mutant in all_mutants().values() if not issubclass(mutant, LaterMutant)]
    found = [mutant for mutant in mutants if quick & set(checks_of(mutant))]
    assert len(found) >= 0.75 * len(mutants), "without those whose fault is in a later connection"


def test_a_quick_run_leaves_out_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = run_kit("sim", "test_axes_apart.py", options=["--robotd-quick"])
    names = {name.partition("[")[0] for name in outcome.passed | outcome.skipped}
    assert names
    assert names <= known_faults.quick_checks()
    assert "further checks were not selected" in capsys.readouterr().out
