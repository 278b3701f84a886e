"""Mutants and broken backends as plugin objects, by the names of their classes."""

from tests.conformance import broken, mutants


def __getattr__(name: str) -> mutants.Mutant:
    """``tests.conformance.installed:Degrees`` is an instance of that mutant."""
    module = mutants if hasattr(mutants, name) else broken
    mutant: type[mutants.Mutant] = getattr(module, name)
    return mutant()
