"""Cases one after the other, each with a robot of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, TypeVar

import click


class CaseResult(Protocol):
    """Result of a case; ``problem`` is empty when it passed."""

    @property
    def problem(self) -> str: ...


Seen = TypeVar("Seen", bound=CaseResult)


def in_turn(cases: Mapping[str, str], run: Callable[[str], Seen]) -> list[Seen]:
    """``run`` each of ``cases`` by its name; summaries and problems go to standard error."""
    seen = []
    for name, summary in cases.items():
        click.echo(f"{name}: {summary}", err=True)
        seen.append(run(name))
        if seen[-1].problem:
            click.echo(f"{name}: {seen[-1].problem}", err=True)
    return seen
