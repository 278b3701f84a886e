"""Backends with one fault each, put into the drivers of the simulation.

A mutant is a plugin of its own and names the check that finds it.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from tests.features.conformance.runs.mutants.plugin import Mutant

THEMES = tuple(path.stem for path in sorted(Path(__file__).parent.glob("*_mutants.py")))


def all_mutants() -> dict[str, type[Mutant]]:
    """Return the mutants of all themes by name."""
    return {
        name: kind
        for theme in THEMES
        for name, kind in vars(import_module(f"{__name__}.{theme}")).items()
        if isinstance(kind, type) and issubclass(kind, Mutant) and kind is not Mutant
    }
