"""Commands of plugins: click commands in the entry-point group ``robotd.commands``.

The entry point's name is the command's: ``canopen = "robotd_canopen.cli:canopen"`` makes
``robotd canopen``. A plugin is imported when its command is called, not to list it.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

import click

from robotd.errors import PluginError

COMMANDS = "robotd.commands"


def plugin_commands() -> list[tuple[str, str]]:
    """Return name and distribution of every command, sorted; imports nothing."""
    return sorted({(entry.name, f"of {_origin(entry)}") for entry in entry_points(group=COMMANDS)})


def plugin_command(name: str) -> click.Command | None:
    """Return the command ``name``; None where no plugin has it.

    Raises PluginError: two distributions bring it, it cannot be imported, or is no click command.
    """
    found = {_origin(entry): entry for entry in entry_points(group=COMMANDS, name=name)}
    if not found:
        return None
    if len(found) > 1:
        both = " and ".join(sorted(found))
        raise PluginError(f"two plugins bring the command {name!r}: {both}; uninstall one")
    [(origin, entry)] = found.items()
    try:
        command = entry.load()
    except (Exception, SystemExit) as error:
        raise PluginError(
            f"command {name!r} of {origin} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(command, click.Command):
        what = type(command).__name__
        raise PluginError(f"command {name!r} of {origin} is not a click command: {what}")
    return command


def _origin(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
