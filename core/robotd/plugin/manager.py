"""Find plugins, register them with pluggy, and call their hooks with a time limit.

Nothing else touches pluggy. A failure of a plugin always becomes a ``PluginError`` that names the
distribution; so does an import or a hook that does not return.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from functools import cached_property, partial
from importlib.metadata import EntryPoint
from typing import Any, TypeVar

import pluggy

from robotd.call_timeout import CallTimeout, call_with_timeout
from robotd.clock import Clock, MonotonicClock
from robotd.descriptor import RobotDescriptor, validate_section
from robotd.device.capabilities import DERIVED, Capability
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.device.passive_joints import PassiveJoints
from robotd.device.payload import PayloadDriver
from robotd.device.world import World
from robotd.device.wrench import WrenchDriver
from robotd.entry_points import API_VERSION, PluginOrigin, installed_names, load_entry
from robotd.errors import (
    PluginError,
    RobotdError,
    did_you_mean,
    plugin_failure,
    unknown_name,
)
from robotd.plugin.code_table import CodeTable, load_code_tables
from robotd.plugin.driver_set import Drivers
from robotd.plugin.hookspecs import (
    BackendInfo,
    DeviceContext,
    RobotdHooks,
)
from robotd.plugin.registry import NodeRegistry, RobotRegistry

BACKENDS = "robotd.backends"
PLUGINS = "robotd.plugins"
HOOK_BUDGET_S = 10.0

_HOOK_OF = {
    Capability.IO: "robotd_io",
    Capability.FIELDBUS: "robotd_fieldbus",
    Capability.PAYLOAD: "robotd_payload",
}

Answer = TypeVar("Answer")


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
    """Return the entry points of ``group`` that can be used, by name; imports nothing."""
    return [*installed_names(group).entries.values()]


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
        except Exception as error:  # its attributes cannot be read
            failure = plugin_failure(error, origin.module)
            raise PluginError(f"plugin {origin} cannot be examined: {failure}") from error
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
        except CallTimeout as late:
            raise PluginError(
                f"plugin {self.origin}: {hook} did not return within {HOOK_BUDGET_S:g} s{late.note}"
            ) from None
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # of a third party, which may raise anything
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
        if derived := sorted(self.info.capabilities & DERIVED):
            raise PluginError(
                f"plugin {origin} declares {', '.join(derived)}: these are derived from its hooks"
            )
        hooks = MANAGER.hooks_of(module)
        derived_from = {capability for capability, hook in _HOOK_OF.items() if hook in hooks}
        self.capabilities = self.info.capabilities | derived_from | {Capability.AXES}
        self.nodes = NodeRegistry(owner=str(origin))
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
            self._maybe("robotd_payload", PayloadDriver, **given),
            self._maybe("robotd_wrenches", WrenchDriver, **given),
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
    names = installed_names(BACKENDS)
    if found := names.require(name):
        return found
    # One that is distributed separately: its command is installed without it.
    if all(
        name in installed_names(group).entries for group in ("robotd.commands", "robotd.doctors")
    ):
        text = f"backend {name!r} is not installed; 'robotd {name} doctor' shows what is missing"
        raise PluginError(f"{text} on this machine, and how to install it")
    raise PluginError(unknown_name("backend", name, names.entries))


def load_backend(name: str) -> Backend:
    """Import and validate the backend ``name`` and no other.

    Raises PluginError: as ``find_backend``, or a plugin that cannot be imported or is not valid.
    """
    return _load(Backend, *find_backend(name))


def load_plugins() -> tuple[list[Plugin], dict[PluginOrigin, str]]:
    """Return every plugin of the group ``robotd.plugins``, and why others failed."""
    names = installed_names(PLUGINS)
    plugins, failures = [], dict(names.refused)
    for origin, entry in names.entries.values():
        try:
            plugins.append(_load(Plugin, origin, entry))
        except PluginError as error:
            failures[origin] = str(error)
    return plugins, failures


def register_all(
    plugins: Iterable[Plugin],
) -> tuple[RobotRegistry, NodeRegistry, dict[PluginOrigin, str]]:
    """Collect robots and nodes of ``plugins``, and why those of some are missing.

    A plugin whose hook fails adds nothing; a node whose name is taken is left out.
    """
    robots, failures = RobotRegistry(), dict[PluginOrigin, str]()
    made: dict[PluginOrigin, NodeRegistry] = {}
    for plugin in sorted(plugins, key=lambda plugin: not plugin.origin.is_own):
        own_robots, own_nodes = RobotRegistry(), NodeRegistry(owner=str(plugin.origin))
        try:
            plugin.call("robotd_register_robots", registry=own_robots)
            plugin.call("robotd_register_nodes", registry=own_nodes)
        except RobotdError as error:
            text = str(error)
            is_named = str(plugin.origin) in text
            failures[plugin.origin] = text if is_named else f"plugin {plugin.origin}: {text}"
        else:
            robots.folders += own_robots.folders
            made[plugin.origin] = own_nodes
    nodes = NodeRegistry.joined(made, failures)
    return robots, nodes, failures


Loaded = TypeVar("Loaded", bound=Plugin)


def _load(
    kind: Callable[[PluginOrigin, object], Loaded], origin: PluginOrigin, entry: EntryPoint
) -> Loaded:
    return kind(origin, load_entry(origin, entry))
