"""The other half of the mutants, see test_mutants.py."""

from __future__ import annotations

import pytest
from tests.features.conformance.runs.conftest import InstallMutant
from tests.features.conformance.runs.mutants.plugin import Mutant
from tests.features.conformance.runs.test_mutants import FOUND, assert_found


@pytest.mark.parametrize("mutant", FOUND[1::2], ids=lambda mutant: mutant.__name__)
def test_a_mutant_fails_the_check_that_names_its_fault(
    mutant: type[Mutant], install_mutant: InstallMutant
) -> None:
    assert_found(mutant, install_mutant)
