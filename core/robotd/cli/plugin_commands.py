"""Commands of robotd and of plugins: click commands in the entry-point group ``robotd.commands``.

The entry point's name is the command's: ``canopen = "robotd_canopen.cli:canopen"`` makes
``robotd canopen``. A command is imported when it is called, not to list it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import click

from robotd.entry_points import PluginOrigin, installed_names, load_entry
from robotd.errors import PluginError

COMMANDS = "robotd.commands"
HEADINGS = {
    "robotd": "Robots and backends",
    "robotd_inventory": "Robots and backends",
    "robotd_ros": "Commands for a running robot",
}
FEATURES, PLUGINS = "Features", "Commands of plugins"


class ListedCommand(NamedTuple):
    """A command as ``robotd --help`` shows it."""

    heading: str
    name: str
    summary: str


def plugin_commands() -> list[ListedCommand]:
    """Return all commands, in the order in which they are shown; imports none of them."""
    listed = [
        ListedCommand(_heading(origin, entry), origin.name, _shown(origin, entry))
        for origin, entry in installed_names(COMMANDS).entries.values()
    ]
    order = [*HEADINGS.values(), FEATURES, PLUGINS]
    return sorted(listed, key=lambda command: order.index(command.heading))


def plugin_command(name: str) -> click.Command | None:
    """Return the command ``name``; None where no distribution has it.

    Raises PluginError: the name is taken, it cannot be imported, or is not a click command.
    """
    found = installed_names(COMMANDS).require(name)
    if found is None:
        return None
    command = load_entry(*found)
    if not isinstance(command, click.Command):
        what = type(command).__name__
        raise PluginError(f"command {found[0]} is not a click command: {what}")
    return command


def _heading(origin: PluginOrigin, entry: EntryPoint) -> str:
    if not origin.is_own:
        return PLUGINS
    return HEADINGS.get(entry.module.partition(".")[0], FEATURES)


def _shown(origin: PluginOrigin, entry: EntryPoint) -> str:
    with suppress(Exception):  # the source of a third party may be anything
        if summary := _summary(entry):
            return summary
    return f"of {origin.release}"


def _summary(entry: EntryPoint) -> str:
    """Return the first line of the command's docstring; "" where it has none.

    It is read from the source: importing all commands would take a second.
    """
    top, *parts = entry.module.split(".")
    spec = find_spec(top)
    if spec is None or spec.origin is None:
        return ""
    # A module beside its package's __init__, or a package, or a module that stands alone.
    folder = Path(spec.origin).parent.joinpath(*parts)
    sources: Sequence[Path] = (
        [folder.with_suffix(".py"), folder / "__init__.py"] if parts else [Path(spec.origin)]
    )
    text = next((path.read_text("utf-8") for path in sources if path.is_file()), "")
    documented = re.search(
        rf'^def {entry.attr}\(.*?"""(.+?)("""|$)', text, re.MULTILINE | re.DOTALL
    )
    return documented[1].strip() if documented else ""
