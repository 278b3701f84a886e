"""Text layout: aligned columns and labelled fields; colour on a terminal only."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from textwrap import wrap

import click

WIDTH = 100
INDENT = 2


def columns(rows: Iterable[Sequence[str]]) -> list[str]:
    """Return ``rows`` with their cells aligned, two spaces apart."""
    table = [list(row) for row in rows]
    widths = [max(map(len, cells)) for cells in zip(*table, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]


def field(label: str, lines: str | Iterable[str], width: int = 10) -> str:
    """Return ``label`` with ``lines`` to its right; a text is wrapped at ``WIDTH``."""
    margin = INDENT + width
    if isinstance(lines, str):
        lines = wrap(lines, WIDTH - margin, break_long_words=False, break_on_hyphens=False)
    first, *rest = list(lines) or [""]
    start = " " * INDENT + click.style(label.ljust(width), dim=True)
    return "\n".join([start + first, *(" " * margin + line for line in rest)])


def heading(text: str) -> str:
    """Style ``text`` as a heading."""
    return click.style(text, bold=True)


def warning(text: str) -> str:
    """Style ``text`` as a warning."""
    return click.style(text, fg="yellow")


def warn(text: str) -> None:
    """Print a warning to standard error."""
    click.echo(f"{click.style('robotd: warning:', fg='yellow', bold=True)} {text}", err=True)
