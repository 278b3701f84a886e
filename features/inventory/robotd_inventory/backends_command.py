"""``robotd backends``: list the installed backends, or check one."""

from __future__ import annotations

from collections.abc import Sequence

import click

from robotd.api import PluginError
from robotd.api.commands import ExitCode, as_json, log_options
from robotd.api.robots import PluginOrigin, discover, load_backend
from robotd_inventory.backend_check import ROBOT, check_backend
from robotd_inventory.listing import Row, print_rows
from robotd_shared.foreign_process import BackendSummary, is_foreign, probe_backend


@click.command("backends")
@as_json
@click.option("--check", "checked", metavar="NAME", help="Examine one backend, without hardware.")
@click.option(
    "--robot",
    metavar="NAME|FILE",
    default=ROBOT,
    show_default=True,
    help="Robot that --check makes the drivers for.",
)
@click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Replace a value of that robot's file. May be repeated.",
)
@log_options
def backends(
    *, as_json: bool, checked: str | None, robot: str, overrides: Sequence[str]
) -> ExitCode:
    """List the installed backends, and why one cannot load."""
    if checked is not None:
        return check_backend(checked, robot, overrides)
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
            backend = _described(origin)
        except PluginError as error:
            row["problem"] = str(error)
        else:
            row |= {
                "summary": backend.summary,
                "capabilities": backend.capabilities,
                "api_version": backend.api_version,
            }
        rows.append(row)
    print_rows(rows, ("capabilities", "api_version", "distribution", "version"), as_json=as_json)
    return ExitCode.OK


def _described(origin: PluginOrigin) -> BackendSummary:
    """Load a backend; a foreign one in a process of its own. Raises PluginError."""
    if is_foreign(origin):
        return probe_backend(origin.name)
    backend = load_backend(origin.name)
    info = backend.info
    return BackendSummary(info.summary, sorted(backend.capabilities), info.api_version)
