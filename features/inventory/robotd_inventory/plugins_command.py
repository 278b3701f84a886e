"""``robotd plugins``: list the installed distributions, what each adds, and what is wrong."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from robotd.api import PluginError, unknown_name
from robotd.api.commands import ExitCode, as_json, field, heading, log_options, warning
from robotd_inventory.plugin_examination import Examined, distributions, examine


@click.command("plugins")
@as_json
@click.option(
    "--check",
    "checked",
    metavar="NAME",
    help="Only this distribution; the status is 4 where something is wrong with it.",
)
@log_options
def plugins(*, as_json: bool, checked: str | None) -> ExitCode:
    """List the installed distributions with plugins, what each adds, and what is wrong with it."""
    listed = distributions()
    if checked is not None:
        wanted = checked.lower().replace("_", "-")
        listed = [
            distribution
            for distribution in listed
            if distribution[0].lower().replace("_", "-") == wanted
        ]
        if not listed:
            known = [name for name, _ in distributions()]
            raise PluginError(unknown_name("distribution with plugins", checked, known))
    found = [examine(*distribution) for distribution in listed]
    if as_json:
        click.echo(json.dumps([asdict(examination) for examination in found], indent=2))
    else:
        for examination in found:
            _show(examination)
    is_wrong = checked is not None and any(examination.problems for examination in found)
    return ExitCode.PLUGIN if is_wrong else ExitCode.OK


def _show(found: Examined) -> None:
    click.echo(heading(f"{found.name} {found.version}"))
    for kind, names in sorted(found.adds.items()):
        if names:
            click.echo(field(kind, [", ".join(names)], width=14))
    if found.problems:
        click.echo(field("wrong", map(warning, found.problems), width=14))
