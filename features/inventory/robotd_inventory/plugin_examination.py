"""Examination of an installed distribution: what it adds to robotd, and what is wrong with it.

A module that is run as a program examines one of a third party, which may end the process.
"""

from __future__ import annotations

import inspect
import json
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import EntryPoint
from pkgutil import resolve_name
from typing import Any

import click

from robotd.api import NodeRegistry, PluginError, RobotdError, RobotRegistry
from robotd.api.bases import base_kind
from robotd.api.commands import (
    KINDS,
    PluginOrigin,
    import_ros,
    installed_names,
    load_code_tables,
    load_entry,
    load_installed,
    plugin_errors,
    unreadable,
)
from robotd.api.features import feature_failures, installed_features
from robotd.api.models import list_robots
from robotd.api.robots import load_backend, load_plugins
from robotd_shared.foreign_process import OWN_DISTRIBUTION, end_of, note_step, run_noted


@dataclass
class Examined:
    """Parts that a distribution adds, and its mistakes.

    Attributes:
        name, version: of the distribution.
        adds: names by kind, such as ``{"command": ["acme"]}``; also "robot", "node", "key" and
            "option".
        problems: texts that name distribution and field.
    """

    name: str
    version: str
    adds: dict[str, list[str]] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)

    def add(self, kind: str, *names: str) -> None:
        """Note names of a kind, once each."""
        known = self.adds.setdefault(kind, [])
        known += [name for name in names if name not in known]

    def check(self, examine: Callable[[], None]) -> None:
        """Call ``examine``; what it raises is a problem."""
        try:
            examine()
        except RobotdError as error:
            self.problems += [line for line in str(error).splitlines() if line not in self.problems]


def distributions() -> list[tuple[str, str]]:
    """Return name and version of all distributions with plugins, robotd first; imports none."""
    names = map(installed_names, KINDS)
    origins = [
        origin
        for entry_names in names
        for origin in (*entry_names.refused, *(found for found, _ in entry_names.entries.values()))
    ]
    found = {(origin.distribution, origin.version) for origin in origins}
    found |= {(name, "?") for name in unreadable() if name not in dict(found)}
    return sorted(found, key=lambda release: (release[0] != OWN_DISTRIBUTION, release))


def examine(name: str, version: str) -> Examined:
    """Examine a distribution; one of a third party in a process of its own, which it may end."""
    if name == OWN_DISTRIBUTION:
        return examine_here(name, version)
    command = [sys.executable, "-m", __name__, name, version]
    status, output, step = run_noted(command, capture=True)
    if step == "done":
        return Examined(**json.loads(output.splitlines()[-1]))
    what = f"{name} {version} ended the process with {end_of(status)} while {step}"
    return Examined(name, version, {}, [what])


def examine_here(name: str, version: str) -> Examined:
    """Import everything that a distribution adds, in this process, and examine it."""
    found = Examined(name, version)
    found.problems += [text for owner, text in unreadable().items() if owner == name]
    for group, kind in KINDS.items():
        names = installed_names(group)
        found.problems += [
            text for origin, text in names.refused.items() if origin.distribution == name
        ]
        for origin, entry in names.entries.values():
            if origin.distribution == name:
                note_step(f"{kind} {origin} is imported and examined")
                if group != "robotd.plugins":
                    found.add(group.removeprefix("robotd.").removesuffix("s"), origin.name)
                examiner = EXAMINERS[group]
                found.check(lambda: examiner(found, origin, entry))  # noqa: B023 - called at once
    return found


def _backend(found: Examined, origin: PluginOrigin, entry: EntryPoint) -> None:
    found.add("node", *load_backend(origin.name).nodes.nodes)


def _base(found: Examined, origin: PluginOrigin, entry: EntryPoint) -> None:
    kind = base_kind(origin.name)
    _examine_target(f"kind of base {origin}: KINEMATICS", kind.KINEMATICS, 1)


def _codes(found: Examined, origin: PluginOrigin, entry: EntryPoint) -> None:
    if text := load_code_tables()[1].get(origin):
        raise PluginError(text)


def _command(found: Examined, origin: PluginOrigin, entry: EntryPoint) -> None:
    command = load_entry(origin, entry)
    if not isinstance(command, click.Command):
        what = type(command).__name__
        raise PluginError(f"command {origin} is not a click command: {what}")


def _feature(found: Examined, origin: PluginOrigin, entry: EntryPoint) -> None:
    if text := feature_failures().get(origin):
        raise PluginError(text)
    feature = installed_features()[origin.name]
    found.add("key", *feature.keys)
    found.add("option", *(option.flag for option in feature.options))
    what = f"feature {origin}"
    targets = [("open", feature.open, 1), ("prepare", feature.prepare, 2)]
    targets += [(f"guards {key!r}", target, 1) for key, target in feature.guards.items()]
    if _has_ros():
        targets.append(("nodes", feature.nodes, 2))
    for part, target, arguments in targets:
        if target:
            found.check(lambda: _examine_target(f"{what}: {part}", target, arguments))  # noqa: B023


def _plugin(found: Examined, origin: PluginOrigin, entry: EntryPoint) -> None:
    plugins, failures = load_plugins()
    failures |= load_installed().failures
    if text := failures.get(origin):
        raise PluginError(text)
    robots, nodes = RobotRegistry(), NodeRegistry()
    [plugin] = [plugin for plugin in plugins if plugin.origin == origin]
    plugin.call("robotd_register_robots", registry=robots)
    plugin.call("robotd_register_nodes", registry=nodes)
    for robot in list_robots(robots.folders):
        found.add("robot", robot.name)
        if robot.problem:
            found.problems.append(f"plugin {origin}: robot {robot.name}: {robot.problem}")
    for name, info in nodes.nodes.items():
        found.add("node", name)
        what = f"plugin {origin}: node {name!r}:"
        if _has_ros():
            found.check(lambda: _examine_target(f"{what} factory", info.factory, 2))  # noqa: B023
        if info.parameters:
            found.check(
                lambda: _examine_target(f"{what} parameters", info.parameters, 2)  # noqa: B023
            )


def _function(found: Examined, origin: PluginOrigin, entry: EntryPoint) -> None:
    what = f"{KINDS[entry.group]} {origin}"
    _examine_call(what, load_entry(origin, entry), 1)


EXAMINERS: dict[str, Callable[[Examined, PluginOrigin, EntryPoint], None]] = {
    "robotd.backends": _backend,
    "robotd.bases": _base,
    "robotd.checks": _function,
    "robotd.codes": _codes,
    "robotd.commands": _command,
    "robotd.doctors": _function,
    "robotd.exports": _function,
    "robotd.features": _feature,
    "robotd.plugins": _plugin,
    "robotd.scans": _function,
}


def _examine_target(what: str, target: str, arguments: int) -> None:
    """Raise PluginError unless ``target`` leads to what takes so many arguments."""
    with plugin_errors(f"{what} ({target})", target):
        made: Any = resolve_name(target)
    _examine_call(f"{what} ({target})", made, arguments)


def _examine_call(what: str, function: Any, arguments: int) -> None:
    if not callable(function):
        raise PluginError(f"{what} is not a function: {type(function).__name__}")
    with suppress(ValueError):  # of compiled code: not known
        try:
            inspect.signature(function).bind(*[None] * arguments)
        except TypeError as error:
            count = f"{arguments} argument{'s' if arguments > 1 else ''}"
            raise PluginError(f"{what} does not take {count}: {error}") from error


def _has_ros() -> bool:
    with suppress(RobotdError):
        import_ros("rclpy")
        return True
    return False


if __name__ == "__main__":
    note_step("its plugins are imported")
    sys.stdout.write(f"\n{json.dumps(asdict(examine_here(*sys.argv[1:])))}\n")
    sys.stdout.flush()
    note_step("done")
    os._exit(0)  # threads of a plugin may go on for ever
