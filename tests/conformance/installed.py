"""The mutants as plugin objects, by the names of their classes."""

from tests.conformance import mutants


def __getattr__(name: str) -> mutants.Mutant:
    """``tests.conformance.installed:Degrees`` is an instance of that mutant."""
    mutant: type[mutants.Mutant] = getattr(mutants, name)
    return mutant()
