"""``robotd robots``: list the robots of the search path."""

from __future__ import annotations

import click

from robotd import descriptor
from robotd.cli.installed import load_installed
from robotd.cli.listing import print_rows
from robotd.cli.options import as_json, configure_logging, log_options


@click.command("robots")
@as_json
@log_options
@click.pass_context
def robots(ctx: click.Context, *, as_json: bool) -> None:
    """List the robots that can be run."""
    configure_logging(ctx)
    list_robots(as_json=as_json)


def list_robots(*, as_json: bool) -> None:
    """Print every robot of the search path, invalid ones with the reason."""
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
        for robot in descriptor.list_robots(installed.search_path)
    ]
    print_rows(rows, ("variants", "path"), as_json=as_json)
