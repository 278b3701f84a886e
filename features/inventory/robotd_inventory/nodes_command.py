"""``robotd nodes``: list the ROS nodes that a descriptor can name."""

from __future__ import annotations

import json

import click

from robotd.api.commands import as_json, columns, load_installed, log_options


@click.command("nodes")
@as_json
@log_options
def nodes(*, as_json: bool) -> None:
    """List the ROS nodes that a robot can name."""
    installed = load_installed()
    installed.warn()
    rows = [
        {"name": name, "summary": info.summary, "factory": info.factory}
        for name, info in installed.nodes.nodes.items()
    ]
    if as_json:
        click.echo(json.dumps(rows, indent=2))
    else:
        click.echo("\n".join(columns((row["name"], row["summary"]) for row in rows)))
