"""Mutants, broken backends and the whole arm as plugin objects, by the names of their classes."""

from __future__ import annotations

from tests.features.conformance.runs import broken, kept_pose, whole_arm
from tests.features.conformance.runs.mutants import all_mutants, buffered


def __getattr__(name: str) -> object:
    """``tests.features.conformance.runs.installed:Degrees`` is an instance of that mutant."""
    classes = all_mutants() | vars(broken) | vars(buffered) | vars(whole_arm) | vars(kept_pose)
    if name not in classes:
        raise AttributeError(name)
    return classes[name]()
