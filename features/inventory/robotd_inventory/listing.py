"""Output of the listing commands: blocks for people, JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

import click

from robotd.api.commands import field, heading, warning

Row = dict[str, Any]


def print_rows(rows: Sequence[Row], details: Iterable[str], *, as_json: bool) -> None:
    """Print ``rows`` as JSON, or as blocks with the fields ``details``."""
    if as_json:
        click.echo(json.dumps(rows, indent=2))
        return
    for row in rows:
        click.echo(f"{heading(row['name'])}  {row['summary']}".rstrip())
        for key in details:
            value = row[key]
            text = ", ".join(value) if isinstance(value, list) else value
            if text:
                click.echo(field(key.replace("_", " "), [str(text)], width=14))
        if row["problem"]:
            click.echo(field("unusable", map(warning, row["problem"].splitlines()), width=14))
