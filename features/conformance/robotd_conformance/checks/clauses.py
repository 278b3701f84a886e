"""Clauses of the driver contract, and the faults against each that make sense (clauses.yaml)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

PATH = Path(__file__).with_suffix(".yaml")


@dataclass(frozen=True)
class Clause:
    """One sentence of the contract, or a part of it.

    Attributes:
        id: ``AxisDriver.stop/all-axes``.
        says: the text, as in the docstring.
        faults: kinds of fault that a driver can have against it.
    """

    id: str
    says: str
    faults: tuple[str, ...]

    @property
    def member(self) -> str:
        """``AxisDriver.stop``."""
        return self.id.partition("/")[0]


@cache
def load() -> tuple[dict[str, Clause], dict[str, str], list[str]]:
    """Return the clauses by id, the kinds of fault with their texts, and the notes."""
    table = yaml.safe_load(PATH.read_text(encoding="utf-8"))
    faults, notes = table.pop("faults"), table.pop("notes")
    clauses = {
        f"{member}/{name}": Clause(f"{member}/{name}", says, tuple(kinds))
        for member, entries in table.items()
        for name, (says, *kinds) in entries.items()
    }
    return clauses, faults, notes
