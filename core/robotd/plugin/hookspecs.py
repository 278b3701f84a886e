"""Every hook of robotd, in the order in which it is called.

A plugin is a module with functions of these names, marked with ``robotd.api.hookimpl``
and announced as an entry point. Hooks are synchronous and run at start-up and shut-down only,
never in the cycle. A hook may take fewer arguments than shown; further ones may be added in
later versions.

Entry-point groups: ``robotd.backends`` (the entry's name is the backend's name; only the one
that is asked for is imported), ``robotd.plugins`` (always imported: robots and nodes), and
``robotd.commands`` (click commands without hooks, each imported when it is called).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import pluggy
from pydantic import BaseModel, ConfigDict

from robotd.clock import Clock, MonotonicClock
from robotd.descriptor import RobotDescriptor
from robotd.device.capabilities import Capability
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.plugin.registry import NodeRegistry, RobotRegistry

API_VERSION = 1

hookspec = pluggy.HookspecMarker("robotd")
hookimpl = pluggy.HookimplMarker("robotd")


class BackendOptions(BaseModel):
    """Base of a backend's section in the descriptor (``backends.<name>``): frozen, strict keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def check_robot(self, robot: RobotDescriptor) -> None:
        """Raise DescriptorError, with every problem, where the section does not fit ``robot``.

        Called before a device is made, and by ``robotd check``; must not touch hardware.
        """


@dataclass(frozen=True)
class BackendInfo:
    """What a backend says of itself without touching hardware.

    Attributes:
        name: the backend's name, equal to its entry point's.
        summary: one line for ``robotd backends``.
        capabilities: what it can do; everything else is answered "not supported".
        api_version: the ``API_VERSION`` it was written for.
        options: model of its descriptor section.
    """

    name: str
    summary: str
    capabilities: frozenset[Capability]
    api_version: int = API_VERSION
    options: type[BackendOptions] = BackendOptions


@dataclass(frozen=True)
class DeviceContext:
    """What a backend gets to know: the robot, its own options, and the clock to live by.

    Attributes:
        robot: the descriptor, with the variant applied.
        options: this backend's validated section.
        clock: monotonic time; a backend uses no other.
    """

    robot: RobotDescriptor
    options: BackendOptions = field(default_factory=BackendOptions)
    clock: Clock = field(default_factory=MonotonicClock)


class RobotdHooks:
    """The specification; never instantiated."""

    @hookspec
    def robotd_register_robots(self, registry: RobotRegistry) -> None:
        """Add folders of robot descriptors. Called once, before a robot is looked up."""

    @hookspec
    def robotd_register_nodes(self, registry: NodeRegistry) -> None:
        """Add ROS nodes by name. Called once, before nodes are made."""

    @hookspec
    def robotd_backend(self) -> BackendInfo:  # type: ignore[empty-body]
        """Describe the backend. Called right after the import; must not touch hardware."""

    @hookspec
    def robotd_open_device(self, context: DeviceContext) -> DeviceDriver:  # type: ignore[empty-body]
        """Make the device driver, not connected yet: ``DeviceDriver.open`` connects."""

    @hookspec
    def robotd_axes(self, device: DeviceDriver, context: DeviceContext) -> AxisDriver:  # type: ignore[empty-body]
        """Make the axis driver of the device. Called once per device."""

    @hookspec
    def robotd_io(self, device: DeviceDriver, context: DeviceContext) -> IoDriver | None:
        """Make the I/O driver of the device, None where there is no I/O."""

    @hookspec
    def robotd_fieldbus(
        self, device: DeviceDriver, context: DeviceContext
    ) -> FieldbusDriver | None:
        """Make the diagnostics driver of the device, None where there is no fieldbus."""

    @hookspec
    def robotd_fault_injector(
        self, device: DeviceDriver, context: DeviceContext
    ) -> FaultInjector | None:
        """Make the handle by which tests play the outside world; None where there is none.

        Called by ``robotd.testing``, and for scenarios on a backend that is ``SIMULATED``; never
        while a real robot is served.
        """
