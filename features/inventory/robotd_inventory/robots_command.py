"""``robotd robots``: list the robots of the search path."""

from __future__ import annotations

import click

from robotd.api.commands import as_json, load_installed, log_options
from robotd.api.models import list_robots
from robotd_inventory.listing import print_rows


@click.command("robots")
@as_json
@log_options
def robots(*, as_json: bool) -> None:
    """List the robots that can be run."""
    installed = load_installed()
    installed.warn()
    rows = [
        {
            "name": robot.name,
            "summary": robot.summary,
            "variants": list(robot.variants),
            "path": str(robot.path),
            "problem": robot.problem,
        }
        for robot in list_robots(installed.search_path)
    ]
    print_rows(rows, ("variants", "path"), as_json=as_json)
