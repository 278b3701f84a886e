"""Commands of robotd and of plugins: click commands in the entry-point group ``robotd.commands``.

The entry point's name is the command's: ``canopen = "robotd_canopen.cli:canopen"`` makes
``robotd canopen``. A command is imported when it is called, not to list it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from importlib.metadata import Distribution, EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import click

from robotd.entry_points import entry_points
from robotd.errors import PluginError

COMMANDS = "robotd.commands"
OWN = "robotd"  # distribution
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
    found = {(entry.name, _origin(entry)): entry for entry in entry_points(group=COMMANDS)}
    own = {entry.name for entry in found.values() if _is_own(entry)}
    listed = [
        ListedCommand(_heading(entry), entry.name, _summary(entry) or f"of {origin}")
        for (_, origin), entry in sorted(found.items())
        if _is_own(entry) or entry.name not in own
    ]
    order = [*HEADINGS.values(), FEATURES, PLUGINS]
    return sorted(listed, key=lambda command: order.index(command.heading))


def plugin_command(name: str) -> click.Command | None:
    """Return the command ``name``; None where no distribution has it. robotd's own go first.

    Raises PluginError: two distributions bring it, it cannot be imported, or is no click command.
    """
    found = {_origin(entry): entry for entry in entry_points(group=COMMANDS, name=name)}
    found = {origin: entry for origin, entry in found.items() if _is_own(entry)} or found
    if not found:
        return None
    if len(found) > 1:
        both = " and ".join(sorted(found))
        raise PluginError(f"two plugins bring the command {name!r}: {both}; uninstall one")
    [(origin, entry)] = found.items()
    command = load_entry(entry, f"command {name!r} of {origin}")
    if not isinstance(command, click.Command):
        what = type(command).__name__
        raise PluginError(f"command {name!r} of {origin} is not a click command: {what}")
    return command


def load_entry(entry: EntryPoint, what: str) -> Any:
    """Import the object of an entry point. Raises PluginError where that fails."""
    try:
        return entry.load()
    except (Exception, SystemExit) as error:
        raise PluginError(f"{what} cannot be imported: {type(error).__name__}: {error}") from error


def _origin(entry: EntryPoint) -> str:
    return " ".join(_name_and_version(entry.dist)) if entry.dist else entry.value


def _is_own(entry: EntryPoint) -> bool:
    return entry.dist is not None and _name_and_version(entry.dist)[0] == OWN


@cache
def _name_and_version(distribution: Distribution) -> tuple[str, str]:
    # Each look at one of them parses the whole METADATA: half the time of `robotd --help`.
    metadata = distribution.metadata
    return metadata["Name"], metadata["Version"]


def _heading(entry: EntryPoint) -> str:
    if not _is_own(entry):
        return PLUGINS
    return HEADINGS.get(entry.module.partition(".")[0], FEATURES)


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
