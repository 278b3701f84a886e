"""Targets of exports: functions in the entry-point group ``robotd.exports``, by the target's name.

Each takes an ``ExportInput`` and returns the text, or the files of a folder by their paths; it
raises DescriptorError where the robot has nothing for the target. A function is imported when its
target is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points

from robotd.api.commands import load_entry
from robotd_export.export_input import ExportInput

EXPORTS = "robotd.exports"

Export = Callable[[ExportInput], str | Mapping[str, str]]


def export_targets() -> list[str]:
    """Return the names of all targets; imports none."""
    return sorted({entry.name for entry in entry_points(group=EXPORTS)})


def export_function(target: str) -> Export:
    """Import the function of a target. Raises PluginError where it cannot be imported."""
    entry = next(iter(entry_points(group=EXPORTS, name=target)))
    function: Export = load_entry(entry, f"export {target!r}")
    return function
