"""Find plugins, register them with pluggy, and call their hooks with a time limit.

Nothing else touches pluggy. A failure of a plugin always becomes a ``PluginError`` that names the
distribution; so does an import or a hook that does not return.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import EntryPoint
from typing import Any, TypeVar

import pluggy

from robotd.clock import Clock, MonotonicClock
from robotd.descriptor import RobotDescriptor, validate_section
from robotd.device.capabilities import DERIVED, Capability
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.device.passive_joints import PassiveJoints
from robotd.device.world import World
from robotd.entry_points import entry_points
from robotd.errors import (
    PluginError,
    RobotdError,
    did_you_mean,
    plugin_failure,
    unknown_name,
)
from robotd.plugin.call_timeout import CallTimeout, call_with_timeout
from robotd.plugin.code_table import CodeTable, load_code_tables
from robotd.plugin.driver_set import Drivers
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

_HOOK_OF = {Capability.IO: "robotd_io", Capability.FIELDBUS: "robotd_fieldbus"}

_NOT_INSTALLED = {
    "wmx": (
        "backend 'wmx' (WMX3 motion engine with its EtherCAT master) is not installed:"
        " pip install ./plugins/wmx, on the machine that has the WMX3 SDK (robotd docs how-to/wmx);"
        " 'robotd wmx doctor' shows what is missing on this machine"
    )
}
"""Backends that are distributed separately, for those who do not have them installed."""

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class PluginOrigin:
    """Origin of a plugin: entry point ``name`` of a distribution, and its module."""

    name: str
    module: str
    distribution: str
    version: str

    def __str__(self) -> str:
        return f"{self.name!r} ({self.module} of {self.distribution} {self.version})"


class PluginManager(pluggy.PluginManager):
    """All plugins of this process. Plugins are validated by pluggy as they are registered."""

    def __init__(self) -> None:
        super().__init__("robotd")
        self.add_hookspecs(RobotdHooks)

    def parse_hookimpl_opts(self, plugin: object, name: str) -> Any:
        """Reject, beyond what pluggy checks, hooks that would never get their arguments."""
        found = super().parse_hookimpl_opts(plugin, name)
        if found is not None and (problem := _signature_problem(name, getattr(plugin, name))):
            raise pluggy.PluginValidationError(plugin, f"{name} must {problem}")
        return found

    def add(self, plugin: object) -> None:
        """Register ``plugin`` once. Raises PluginValidationError; nothing stays registered."""
        if self.is_registered(plugin):
            return
        try:
            self.register(plugin, f"{type(plugin).__name__} {id(plugin):#x}")  # no name is taken
            self.check_pending()
        except pluggy.PluginValidationError:
            if self.is_registered(plugin):
                self.unregister(plugin)
            raise

    def hooks_of(self, plugin: object) -> frozenset[str]:
        """Return the names of the hooks that ``plugin`` implements."""
        return frozenset(caller.name for caller in self.get_hookcallers(plugin) or ())


MANAGER = PluginManager()


def discover(group: str = BACKENDS) -> list[tuple[PluginOrigin, EntryPoint]]:
    """Return all entry points of ``group``, sorted by name; imports nothing."""
    found = []
    for entry in entry_points(group=group):
        dist = entry.dist
        name, version = (dist.name, dist.version) if dist else ("unknown", "?")
        found.append((PluginOrigin(entry.name, entry.value, name, version), entry))
    return sorted(set(found), key=lambda item: (item[0].name, item[0].distribution))


class Plugin:
    """One registered plugin, and calls of its hooks with a time limit."""

    def __init__(self, origin: PluginOrigin, module: object) -> None:
        self.origin = origin
        self._module = module
        try:
            MANAGER.add(module)
        except pluggy.PluginValidationError as error:
            self._check_version()
            what = str(error)
            if unknown := re.match(r"unknown hook '(\w+)'", what):
                what = unknown[0] + did_you_mean(unknown[1], dir(RobotdHooks))
            raise PluginError(f"plugin {origin}: {what}") from error
        if not MANAGER.hooks_of(module):
            raise PluginError(
                f"plugin {origin} has no robotd hook; mark them with robotd.api.hookimpl"
            )

    def _check_version(self) -> None:
        """A plugin of another API version fails validation; only a backend has a version."""

    def call(self, hook: str, **arguments: object) -> Any:
        """Call ``hook``; None: no answer. Raises PluginError: it fails or does not return."""
        # Of this plugin alone: there may be several backends in a process.
        others = [other for other in MANAGER.get_plugins() if other is not self._module]
        return self._limited(hook, partial(MANAGER.subset_hook_caller(hook, others), **arguments))

    def _limited(self, hook: str, call: Callable[[], Answer]) -> Answer:
        try:
            return call_with_timeout(HOOK_BUDGET_S, call, hook)
        except RobotdError:
            raise
        except CallTimeout:
            raise PluginError(
                f"plugin {self.origin}: {hook} did not return within {HOOK_BUDGET_S:g} s"
            ) from None
        except (Exception, SystemExit) as error:
            failure = plugin_failure(error, self.origin.module)
            raise PluginError(f"plugin {self.origin}: {hook} failed: {failure}") from error


class Backend(Plugin):
    """A loaded backend: its description, and the maker of its drivers.

    Attributes:
        name: of the entry point.
        capabilities: declared ones, and those of the hooks that it has.
        nodes: ROS nodes that are served with every robot on it.
    """

    def __init__(self, origin: PluginOrigin, module: object) -> None:
        self.name = origin.name
        super().__init__(origin, module)
        self.info: BackendInfo = self._one("robotd_backend", BackendInfo)
        self._require_version(self.info.api_version)
        options: Any = self.info.options
        if not (isinstance(options, type) and issubclass(options, BackendOptions)):
            raise PluginError(f"plugin {origin}: its options do not derive from BackendOptions")
        if derived := sorted(self.info.capabilities & DERIVED):
            raise PluginError(
                f"plugin {origin} declares {', '.join(derived)}: these are derived from its hooks"
            )
        hooks = MANAGER.hooks_of(module)
        derived_from = {capability for capability, hook in _HOOK_OF.items() if hook in hooks}
        self.capabilities = self.info.capabilities | derived_from | {Capability.AXES}
        self.nodes = NodeRegistry()
        self.call("robotd_register_nodes", registry=self.nodes)

    @cached_property
    def code_tables(self) -> list[CodeTable]:
        """Tables of its codes; imported at the first use."""
        return load_code_tables(self.origin.module.partition(".")[0])[0]

    def advise(self, code: int) -> str:
        """Return what to do about the code of an alarm; "" where unknown."""
        return next(filter(None, (table.advice(code) for table in self.code_tables)), "")

    def context(self, robot: RobotDescriptor, clock: Clock | None = None) -> DeviceContext[Any]:
        """Validate the robot's section for this backend, once, and return the context of a device.

        Raises DescriptorError with every problem.
        """
        options = validate_section(robot, f"backends.{self.name}", self.info.options)
        checked = self._limited("check_robot", lambda: options.check_robot(robot))
        return DeviceContext(robot, checked, clock or MonotonicClock())

    def drivers(self, context: DeviceContext[Any]) -> Drivers:
        """Make a device and its drivers, behind fault isolation; nothing is opened.

        Raises PluginError: a hook fails, or a declared capability lacks its methods.
        """
        device = self._one("robotd_open_device", DeviceDriver, context=context)
        given = {"device": device, "context": context}
        drivers = Drivers(
            device,
            self._one("robotd_axes", AxisDriver, **given),
            self._maybe("robotd_io", IoDriver, **given),
            self._maybe("robotd_fieldbus", FieldbusDriver, **given),
            lambda: self._maybe("robotd_fault_injector", FaultInjector, **given),
            self._maybe("robotd_passive_joints", PassiveJoints, **given),
            self._maybe("robotd_world", World, **given),
        )
        if missing := drivers.missing(self.info.capabilities):
            raise PluginError(f"plugin {self.origin}: {'; '.join(missing)}")
        return drivers.isolated(str(self.origin), self.name)

    def _check_version(self) -> None:
        describe = getattr(self._module, "robotd_backend", None)
        info = self._limited("robotd_backend", describe) if callable(describe) else None
        if isinstance(info, BackendInfo):
            self._require_version(info.api_version)

    def _require_version(self, version: int) -> None:
        if version != API_VERSION:
            raise PluginError(
                f"plugin {self.origin} is written for robotd plugin API {version},"
                f" this is API {API_VERSION}: install a matching version of"
                f" {self.origin.distribution}"
            )

    def _one(self, hook: str, kind: type[Answer], **arguments: object) -> Answer:
        result = self._maybe(hook, kind, **arguments)
        if result is None:
            raise PluginError(f"plugin {self.origin} does not answer the hook {hook}")
        return result

    def _maybe(self, hook: str, kind: type[Answer], **arguments: object) -> Answer | None:
        result = self.call(hook, **arguments)
        if result is not None and not isinstance(result, kind):
            raise PluginError(
                f"plugin {self.origin}: {hook} returned {type(result).__name__},"
                f" not a {kind.__name__}"
            )
        return result


def _signature_problem(name: str, function: Callable[..., object]) -> str:
    """Return why pluggy would not pass all arguments, or ""."""
    if inspect.iscoroutinefunction(function):
        return "not be async"
    hook = getattr(RobotdHooks, name, None)
    known = [*inspect.signature(hook).parameters][1:] if hook else []
    for argument in inspect.signature(function).parameters.values():
        if hook and argument.name not in known:
            return f"not take {argument.name!r} (available: {', '.join(known) or 'none'})"
        if argument.kind is argument.KEYWORD_ONLY or argument.default is not argument.empty:
            return (
                f"take {argument.name!r} as a plain argument without a default,"
                " otherwise it is not handed over"
            )
    return ""


def find_backend(name: str) -> tuple[PluginOrigin, EntryPoint]:
    """Return origin and entry point of the backend ``name``; imports nothing.

    Raises PluginError: unknown name (with the known ones), or two distributions with that name.
    """
    found = discover()
    matches = [(origin, entry) for origin, entry in found if origin.name == name]
    if not matches:
        if text := _NOT_INSTALLED.get(name):
            raise PluginError(text)
        known = sorted({origin.name for origin, _ in found})
        raise PluginError(unknown_name("backend", name, known))
    if len(matches) > 1:
        both = " and ".join(str(origin) for origin, _ in matches)
        raise PluginError(f"two plugins offer the backend {name!r}: {both}; uninstall one")
    return matches[0]


def load_backend(name: str) -> Backend:
    """Import and validate the backend ``name`` and no other.

    Raises PluginError: as ``find_backend``, or a plugin that cannot be imported or is not valid.
    """
    return _load(Backend, *find_backend(name))


def load_plugins() -> tuple[list[Plugin], dict[PluginOrigin, str]]:
    """Return every plugin of the group ``robotd.plugins``, and why others failed."""
    plugins, failures = [], {}
    for origin, entry in discover(PLUGINS):
        try:
            plugins.append(_load(Plugin, origin, entry))
        except PluginError as error:
            failures[origin] = str(error)
    return plugins, failures


def register_all(plugins: Iterable[Plugin]) -> tuple[RobotRegistry, NodeRegistry]:
    """Collect robots and nodes of ``plugins``, robotd's own first."""
    robots, nodes = RobotRegistry(), NodeRegistry()
    for plugin in sorted(plugins, key=lambda plugin: plugin.origin.distribution != "robotd"):
        plugin.call("robotd_register_robots", registry=robots)
        plugin.call("robotd_register_nodes", registry=nodes)
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
            f"plugin {origin} cannot be imported: {plugin_failure(error, origin.module)}"
            f"{_version_hint(error)}"
        ) from error
    return kind(origin, module)


def _version_hint(error: BaseException) -> str:
    """A plugin of another API version imports names that this one does not have."""
    if isinstance(error, ImportError) and (error.name or "").partition(".")[0] == "robotd":
        return f"; is it written for another plugin API? This is API {API_VERSION}"
    return ""
