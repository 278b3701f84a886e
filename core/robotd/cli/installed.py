"""Installed robots and nodes, including those of plugins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robotd.cli.layout import warn
from robotd.descriptor import (
    Override,
    RobotDescriptor,
    default_search_path,
    load_robot_descriptor,
)
from robotd.entry_points import unreadable
from robotd.errors import DescriptorError
from robotd.plugin.manager import PluginOrigin, load_plugins, register_all
from robotd.plugin.registry import NodeRegistry


@dataclass(frozen=True)
class Installed:
    """Names that are valid on the command line and in a descriptor.

    Attributes:
        search_path: folders of robots, robotd's own first.
        nodes: built-in nodes and those of plugins.
        failures: plugins that failed to load, with the reason.
    """

    search_path: tuple[Path, ...]
    nodes: NodeRegistry
    failures: Mapping[PluginOrigin, str]

    def warn(self) -> None:
        """Warn about plugins that failed; their robots and nodes are missing."""
        for reason in self.problems():
            warn(reason)

    def problems(self) -> list[str]:
        """Return what is wrong with plugins, and with files of distributions."""
        return [*unreadable().values(), *self.failures.values()]


def load_installed() -> Installed:
    """Load every plugin; one that fails is a failure, and hides no other. Raises nothing."""
    plugins, failures = load_plugins()
    robots, nodes, missing = register_all(plugins)
    search_path = (*default_search_path(), *robots.folders)
    return Installed(search_path, nodes, failures | missing)


def load_robot(
    robot: str, variant: str | None = None, overrides: Sequence[Override] = ()
) -> RobotDescriptor:
    """Load a robot, also one of a plugin, by name or file. Raises DescriptorError."""
    return load_robot_descriptor(robot, variant, load_installed().search_path, overrides)


def check_backend_overrides(overrides: Iterable[Override], backend: str) -> None:
    """Raise DescriptorError for an override of a backend that is not the one in use.

    It would have no effect, and nothing else would notice.
    """
    for override in overrides:
        if override.keys[0] == "backends" and override.keys[1:2] != (backend,):
            raise DescriptorError(
                f"the backend in use is {backend!r}", path=override.node.path, key=override.key
            )
