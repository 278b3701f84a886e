"""Mutants, broken backends and the whole arm as plugin objects, by the names of their classes."""

from __future__ import annotations

from collections import ChainMap

from tests.features.conformance.runs import broken, faultless, kept_pose, whole_arm
from tests.features.conformance.runs.mutants import all_mutants, buffered


def __getattr__(name: str) -> object:
    """``tests.features.conformance.runs.installed:Degrees`` is an instance of that mutant."""
    modules = (broken, buffered, faultless, kept_pose, whole_arm)
    classes = dict(ChainMap(all_mutants(), *map(vars, modules)))
    if name not in classes:
        raise AttributeError(name)
    return classes[name]()
