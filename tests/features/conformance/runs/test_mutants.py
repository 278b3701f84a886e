"""Each mutant fails the checks that name its fault: one half here, one in test_other_mutants.py.

A file is run by one worker, and all of them take twenty minutes.
"""

from __future__ import annotations

import re

import pytest
from tests.features.conformance.runs.conftest import InstallMutant
from tests.features.conformance.runs.kit import run_kit
from tests.features.conformance.runs.mutants import all_mutants
from tests.features.conformance.runs.mutants.plugin import Mutant

FOUND = [mutant for mutant in all_mutants().values() if mutant.found_by]
GOAL = 0.95


def assert_found(mutant: type[Mutant], install_mutant: InstallMutant) -> None:
    """Run the checks that name the mutant's fault: these fail, and say what they have to."""
    checks = (mutant.found_by,) if isinstance(mutant.found_by, str) else mutant.found_by
    chosen = [f"{check}[{mutant.only}]" if mutant.only else check for check in checks]
    outcome = run_kit(install_mutant(mutant), *chosen, robot=mutant.robot)
    failed = outcome.failed | outcome.inconclusive  # on a busy computer no attempt has passed
    assert {name.partition("[")[0] for name in failed} == set(checks)
    assert all(re.search(mutant.says, failure) for failure in failed.values())


@pytest.mark.parametrize("mutant", FOUND[::2], ids=lambda mutant: mutant.__name__)
def test_a_mutant_fails_the_check_that_names_its_fault(
    mutant: type[Mutant], install_mutant: InstallMutant
) -> None:
    assert_found(mutant, install_mutant)


def test_nearly_every_mutant_is_found() -> None:
    assert len(FOUND) >= GOAL * len(all_mutants())
