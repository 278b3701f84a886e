"""Values that a shell completes: robots, backends and joints; imports nothing before it is asked.

Plugins are loaded for it, so that it takes half a second.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import click
from click.shell_completion import CompletionItem

from robotd.entry_points import entry_points

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def complete_robots(
    ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return the installed robots; files where the word is a path."""
    if "/" in incomplete or incomplete.startswith("."):
        return [CompletionItem(incomplete, type="file")]
    return _beginning(incomplete, installed_robots())


def installed_robots() -> list[str]:
    """Return the names of the robots that can be run."""
    from robotd.cli.installed import load_installed
    from robotd.descriptor import list_robots

    return [robot.name for robot in list_robots(load_installed().search_path)]


def complete_backends(
    ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return the installed backends; imports none."""
    return _beginning(incomplete, {entry.name for entry in entry_points(group="robotd.backends")})


def joint_completion(suffix: str = "") -> Complete:
    """Return a function that completes joints of the installed robots, followed by ``suffix``."""

    def complete(
        ctx: click.Context, parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        from robotd.cli.installed import load_installed
        from robotd.descriptor import list_robots, load_robot_descriptor
        from robotd.errors import DescriptorError

        path, joints = load_installed().search_path, dict[str, None]()
        for robot in list_robots(path):
            try:
                found = load_robot_descriptor(robot.name, None, path).joint_names
            except DescriptorError:
                continue
            joints |= dict.fromkeys(f"{joint}{suffix}" for joint in found)
        return _beginning(incomplete, joints)

    return complete


def _beginning(incomplete: str, names: Iterable[str]) -> list[CompletionItem]:
    return [CompletionItem(name) for name in sorted(names) if name.startswith(incomplete)]
