"""``robotd robots``, ``robotd backends``, ``robotd nodes``: what can be named."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

import click

from robotd import descriptor
from robotd.cli.catalogue import load_catalogue
from robotd.cli.layout import columns, field, heading, warning
from robotd.errors import PluginError
from robotd.plugin.manager import discover, load_backend
from robotd.ros.registry import known_nodes

Row = dict[str, Any]


def list_robots(*, as_json: bool) -> None:
    """Every robot of the search path, broken ones with the reason."""
    catalogue = load_catalogue()
    catalogue.warn()
    rows = [
        {
            "name": robot.name,
            "summary": robot.summary,
            "variants": list(robot.variants),
            "path": str(robot.path),
            "problem": robot.problem,
        }
        for robot in descriptor.list_robots(catalogue.search_path)
    ]
    _show(rows, ("variants", "path"), as_json=as_json)


def list_backends(*, as_json: bool) -> None:
    """Every installed backend; each is imported, and one that fails is shown with the reason."""
    rows = []
    for origin, _ in discover():
        row: Row = {
            "name": origin.name,
            "summary": "",
            "capabilities": [],
            "api_version": None,
            "distribution": origin.distribution,
            "version": origin.version,
            "problem": None,
        }
        try:
            backend = load_backend(origin.name)
        except PluginError as error:
            row["problem"] = str(error)
        else:
            row |= {
                "summary": backend.info.summary,
                "capabilities": sorted(backend.capabilities),
                "api_version": backend.info.api_version,
            }
        rows.append(row)
    _show(rows, ("capabilities", "api_version", "distribution", "version"), as_json=as_json)


def list_nodes(*, as_json: bool) -> None:
    """Every node by name, those of plugins too."""
    catalogue = load_catalogue()
    catalogue.warn()
    rows = [
        {"name": name, "summary": info.summary, "factory": info.factory}
        for name, info in known_nodes(catalogue.nodes).items()
    ]
    if as_json:
        click.echo(json.dumps(rows, indent=2))
    else:
        click.echo("\n".join(columns((row["name"], row["summary"]) for row in rows)))


def _show(rows: Sequence[Row], details: Iterable[str], *, as_json: bool) -> None:
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
