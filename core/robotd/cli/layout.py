"""Plain text for people: aligned columns, and fields with a label. Colour only on a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from textwrap import wrap

import click

WIDTH = 100
INDENT = 2


def columns(rows: Iterable[Sequence[str]]) -> list[str]:
    """``rows`` with their cells aligned, two spaces apart."""
    table = [list(row) for row in rows]
    widths = [max(map(len, cells)) for cells in zip(*table, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]


def field(label: str, lines: str | Iterable[str], width: int = 10) -> str:
    """``label`` and, to the right of it, ``lines``; a text is wrapped at ``WIDTH``."""
    margin = INDENT + width
    if isinstance(lines, str):
        lines = wrap(lines, WIDTH - margin, break_long_words=False, break_on_hyphens=False)
    first, *rest = list(lines) or [""]
    start = " " * INDENT + click.style(label.ljust(width), dim=True)
    return "\n".join([start + first, *(" " * margin + line for line in rest)])


def heading(text: str) -> str:
    """Bold."""
    return click.style(text, bold=True)


def warning(text: str) -> str:
    """In the colour of warnings."""
    return click.style(text, fg="yellow")


def warn(text: str) -> None:
    """A warning on standard error, one sentence."""
    click.echo(f"{click.style('robotd: warning:', fg='yellow', bold=True)} {text}", err=True)
