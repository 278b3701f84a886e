"""Aspects of the clauses (aspects.yaml): what can be wrong, and which checks look at it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from robotd_conformance.checks import clauses

PATH = Path(__file__).with_suffix(".yaml")
OPEN = "open"


@dataclass(frozen=True)
class Aspect:
    """One column of the matrix.

    Attributes:
        faults: kinds of fault of mutants that belong to it.
        themes: files of checks that are about it, without ``test_``.
        without: letter of the reason why a clause cannot have a check, by the clauses it holds for;
            a clause is named whole, or by the start of its id.
    """

    faults: tuple[str, ...]
    themes: tuple[str, ...]
    without: dict[str, tuple[str, ...]]

    def reason(self, clause: str) -> str:
        """Return the letter of the reason for ``clause``, or ``OPEN``."""
        for letter, begins in self.without.items():
            if any(clause.startswith(begin) for begin in begins):
                return letter
        return OPEN


def load() -> tuple[dict[str, Aspect], dict[str, str]]:
    """Return the aspects by name, and the reasons by letter."""
    content = yaml.safe_load(PATH.read_text(encoding="utf-8"))
    aspects = {
        name: Aspect(
            tuple(table["faults"]),
            tuple(table.get("themes", ())),
            {letter: tuple(begins) for letter, begins in table.get("without", {}).items()},
        )
        for name, table in content["aspects"].items()
    }
    return aspects, content["reasons"]


def cells(
    found: Iterable[tuple[str, str, Sequence[str]]], bearing: Mapping[str, Sequence[str]]
) -> dict[str, dict[str, str]]:
    """Return the cell of each clause and aspect: number of checks, letter of a reason, or ``OPEN``.

    Args:
        found: clause and kind of fault of each mutant, and the checks that find it.
        bearing: checks by the clause that they bear, as ``test_units.py::test_…``.
    """
    mutants, (aspects, _) = list(found), load()
    table: dict[str, dict[str, str]] = {}
    for clause in clauses.load()[0]:
        own = [(fault, checks) for id_, fault, checks in mutants if id_ == clause]
        table[clause] = {}
        for name, aspect in aspects.items():
            by = {check for fault, checks in own if fault in aspect.faults for check in checks}
            by |= {check for check in bearing.get(clause, ()) if _theme(check) in aspect.themes}
            table[clause][name] = str(len(by)) if by else aspect.reason(clause)
    return table


def _theme(check: str) -> str:
    return check.partition(".py::")[0].removeprefix("test_")
