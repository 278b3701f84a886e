"""Find backend plugins, load the one that is wanted, and call its hooks by typed methods.

Nobody else touches pluggy. A plugin's failure always becomes a ``PluginError`` that names the
distribution it came from; so does an import or a hook that does not end. The drivers that a
backend makes are handed out behind a guard.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

import pluggy

from robotd.descriptor import RobotDescriptor, validate_section
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.errors import PluginError, RobotdError
from robotd.plugin.call_timeout import CallTimeout, call_with_timeout
from robotd.plugin.fault_isolation import isolated, unguarded
from robotd.plugin.hookspecs import (
    API_VERSION,
    BackendInfo,
    BackendOptions,
    DeviceContext,
    RobotdHooks,
)
from robotd.plugin.registry import NodeRegistry, RobotRegistry

BACKENDS = "robotd.backends"
PLUGINS = "robotd.plugins"
IMPORT_BUDGET_S = 30.0
HOOK_BUDGET_S = 10.0

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class PluginOrigin:
    """Where a plugin comes from: entry point ``name`` of a distribution, and its module."""

    name: str
    module: str
    distribution: str
    version: str

    def __str__(self) -> str:
        return f"{self.name!r} ({self.module} of {self.distribution} {self.version})"


def discover(group: str = BACKENDS) -> list[tuple[PluginOrigin, EntryPoint]]:
    """All entry points of ``group``, sorted by name; imports nothing."""
    found = []
    for entry in entry_points(group=group):
        dist = entry.dist
        name, version = (dist.name, dist.version) if dist else ("unknown", "?")
        found.append((PluginOrigin(entry.name, entry.value, name, version), entry))
    return sorted(set(found), key=lambda item: (item[0].name, item[0].distribution))


class Plugin:
    """One validated plugin and the typed calls of the hooks that any plugin may have."""

    def __init__(self, origin: PluginOrigin, module: object) -> None:
        self.origin = origin
        self._manager = pluggy.PluginManager("robotd")
        self._manager.add_hookspecs(RobotdHooks)
        self._register(module)

    def register_robots(self, registry: RobotRegistry) -> None:
        self._call("robotd_register_robots", registry=registry)

    def register_nodes(self, registry: NodeRegistry) -> None:
        self._call("robotd_register_nodes", registry=registry)

    def _register(self, module: object) -> None:
        try:
            self._manager.register(module, self.origin.name)
            self._manager.check_pending()
        except pluggy.PluginValidationError as error:
            raise PluginError(f"plugin {self.origin}: {error}") from error
        callers = self._manager.get_hookcallers(module)
        if not callers:
            raise PluginError(
                f"plugin {self.origin} has no robotd hook; mark them with robotd.api.hookimpl"
            )
        for caller in callers:
            for implementation in caller.get_hookimpls():
                self._check_function(caller.name, implementation.function)

    def _check_function(self, hook: str, function: Callable[..., object]) -> None:
        if inspect.iscoroutinefunction(function):
            raise PluginError(f"plugin {self.origin}: {hook} must not be async")
        for argument in inspect.signature(function).parameters.values():
            if argument.kind is argument.KEYWORD_ONLY or argument.default is not argument.empty:
                raise PluginError(
                    f"plugin {self.origin}: {hook} must take {argument.name!r} as a plain argument"
                    " without a default, otherwise it is not handed over"
                )

    def _call(self, hook: str, **arguments: object) -> list[Any]:
        caller = getattr(self._manager.hook, hook)
        return list(self._within_budget(hook, lambda: caller(**arguments)))

    def _within_budget(self, hook: str, call: Callable[[], Answer]) -> Answer:
        try:
            return call_with_timeout(HOOK_BUDGET_S, call, hook)
        except RobotdError:
            raise
        except CallTimeout:
            raise PluginError(
                f"plugin {self.origin}: {hook} did not return within {HOOK_BUDGET_S:g} s"
            ) from None
        except (Exception, SystemExit) as error:
            raise PluginError(
                f"plugin {self.origin}: {hook} failed: {type(error).__name__}: {error}"
            ) from error


class Backend(Plugin):
    """A loaded backend: its description, and the makers of its drivers."""

    def __init__(self, origin: PluginOrigin, module: object) -> None:
        super().__init__(origin, module)
        self.info = self._one("robotd_backend", BackendInfo)
        if self.info.api_version != API_VERSION:
            raise PluginError(
                f"plugin {origin} is written for robotd plugin API {self.info.api_version},"
                f" this is API {API_VERSION}: install a matching version of {origin.distribution}"
            )
        if self.info.name != origin.name:
            raise PluginError(f"plugin {origin} calls itself {self.info.name!r}")

    def options(self, robot: RobotDescriptor) -> BackendOptions:
        """The robot's section for this backend, validated. Raises DescriptorError."""
        options = validate_section(robot, f"backends.{self.info.name}", self.info.options)
        self._within_budget("check_robot", lambda: options.check_robot(robot))
        return options

    def open_device(self, context: DeviceContext) -> DeviceDriver:
        device = self._one("robotd_open_device", DeviceDriver, context=context)
        return isolated(device, DeviceDriver, str(self.origin))

    def axes(self, device: DeviceDriver, context: DeviceContext) -> AxisDriver:
        made = self._one("robotd_axes", AxisDriver, device=unguarded(device), context=context)
        return isolated(made, AxisDriver, str(self.origin))

    def io(self, device: DeviceDriver, context: DeviceContext) -> IoDriver | None:
        made = self._maybe("robotd_io", IoDriver, device=unguarded(device), context=context)
        return made and isolated(made, IoDriver, str(self.origin))

    def fieldbus(self, device: DeviceDriver, context: DeviceContext) -> FieldbusDriver | None:
        own = unguarded(device)
        made = self._maybe("robotd_fieldbus", FieldbusDriver, device=own, context=context)
        return made and isolated(made, FieldbusDriver, str(self.origin))

    def fault_injector(self, device: DeviceDriver, context: DeviceContext) -> FaultInjector | None:
        """The handle by which tests play the outside world; None where there is none."""
        return self._maybe(
            "robotd_fault_injector", FaultInjector, device=unguarded(device), context=context
        )

    def _one(self, hook: str, kind: type[Answer], **arguments: object) -> Answer:
        result = self._maybe(hook, kind, **arguments)
        if result is None:
            raise PluginError(f"plugin {self.origin} does not answer the hook {hook}")
        return result

    def _maybe(self, hook: str, kind: type[Answer], **arguments: object) -> Answer | None:
        results = self._call(hook, **arguments)
        if not results:
            return None
        if not isinstance(results[0], kind):
            raise PluginError(
                f"plugin {self.origin}: {hook} returned {type(results[0]).__name__},"
                f" not a {kind.__name__}"
            )
        return results[0]


def load_backend(name: str) -> Backend:
    """Import and validate the backend ``name`` and no other.

    Raises PluginError: unknown name (with the known ones), two distributions with that name,
    or a plugin that cannot be imported or does not fit.
    """
    found = discover()
    matches = [(origin, entry) for origin, entry in found if origin.name == name]
    if not matches:
        known = sorted({origin.name for origin, _ in found})
        near = get_close_matches(name, known, 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise PluginError(
            f"no backend named {name!r} is installed (installed: {', '.join(known)}){hint}"
        )
    if len(matches) > 1:
        both = " and ".join(str(origin) for origin, _ in matches)
        raise PluginError(f"two plugins offer the backend {name!r}: {both}; uninstall one")
    return _load(Backend, *matches[0])


def load_plugins() -> tuple[list[Plugin], dict[PluginOrigin, str]]:
    """Every plugin of the group ``robotd.plugins``, and the reasons of those that failed."""
    plugins, failures = [], {}
    for origin, entry in discover(PLUGINS):
        try:
            plugins.append(_load(Plugin, origin, entry))
        except PluginError as error:
            failures[origin] = str(error)
    return plugins, failures


def register_all(plugins: Iterable[Plugin]) -> tuple[RobotRegistry, NodeRegistry]:
    """Collect robots and nodes of ``plugins``."""
    robots, nodes = RobotRegistry(), NodeRegistry()
    for plugin in plugins:
        plugin.register_robots(robots)
        plugin.register_nodes(nodes)
    return robots, nodes


Loaded = TypeVar("Loaded", bound=Plugin)


def _load(
    kind: Callable[[PluginOrigin, object], Loaded], origin: PluginOrigin, entry: EntryPoint
) -> Loaded:
    try:
        module = call_with_timeout(IMPORT_BUDGET_S, entry.load, f"import {origin.module}")
    except CallTimeout:
        raise PluginError(
            f"plugin {origin} cannot be imported: not done within {IMPORT_BUDGET_S:g} s"
        ) from None
    except (Exception, SystemExit) as error:
        raise PluginError(
            f"plugin {origin} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    return kind(origin, module)
