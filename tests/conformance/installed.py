"""Mutants, broken backends and the whole arm as plugin objects, by the names of their classes."""

from tests.conformance import broken, more_mutants, mutants, whole_arm


def __getattr__(name: str) -> object:
    """``tests.conformance.installed:Degrees`` is an instance of that mutant."""
    modules = (mutants, more_mutants, broken, whole_arm)
    return next(getattr(module, name)() for module in modules if hasattr(module, name))
