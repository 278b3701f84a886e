"""Hooks of robotd, in the order in which they are called.

A plugin is a module with functions of these names, marked with ``robotd.api.hookimpl`` and
registered as an entry point. Hooks are synchronous and run at start-up and shut-down only, never
in the control loop. A hook may take fewer arguments than shown; later versions may add some.

``device`` is the very object that ``robotd_open_device`` returned: annotate it with its class.
So is ``context``: ``DeviceContext[AcmeOptions]``. No cast is needed.

Entry-point groups: ``robotd.backends`` (the entry's name is the backend's name; only the one
that is asked for is imported), ``robotd.plugins`` (always imported: robots and nodes), and
``robotd.commands`` (click commands without hooks, each imported when it is called).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import pluggy
from pydantic import BaseModel, ConfigDict
from pydantic.dataclasses import dataclass as pydantic_dataclass

from robotd.clock import Clock, MonotonicClock
from robotd.descriptor import RobotDescriptor
from robotd.device.capabilities import Capability
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.device.passive_joints import PassiveJoints
from robotd.device.payload import PayloadDriver
from robotd.device.world import World
from robotd.device.wrench import WrenchDriver
from robotd.plugin.registry import NodeRegistry, RobotRegistry

hookspec = pluggy.HookspecMarker("robotd")
hookimpl = pluggy.HookimplMarker("robotd")


class BackendOptions(BaseModel):
    """Base of a backend's section in the descriptor (``backends.<name>``): frozen, strict keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def check_robot(self, robot: RobotDescriptor) -> Any:
        """Check the section against ``robot``; return what the backend works with.

        The result becomes ``DeviceContext.options``: the options themselves, or what was
        computed from them and the robot, so that nothing is computed twice. Called once for a
        device, and by ``robotd check``; must not touch hardware. Raises DescriptorError with
        every problem.
        """
        return self


StatedScales = Callable[[Callable[[int, int], int], Mapping[str, Any]], Mapping[str, float]]


@dataclass(frozen=True)
class AxisKeys:
    """Keys of an axis in a backend's section, which ``robotd commission`` writes.

    The section has a list of axes, whose items name theirs by ``axis``.

    Attributes:
        items: key of the list.
        scale: counts per rad (or m) of the joint, positive.
        polarity: 1 or -1.
        node: id of the drive, as in ``BusNode.id``.
        identity: mapping with ``vendor_id`` and ``product_code``.
        window_object: object whose value is the following-error window in counts, written by an
            item ``{object, value}`` of ``startup``; "": none.
        stated_scales: returns the counts per turn that a drive states, by the objects that state
            them; its arguments are a reader of object and subindex, and the axis' item. None: a
            drive states none.
    """

    items: str
    scale: str
    polarity: str
    node: str
    identity: str
    window_object: str = ""
    stated_scales: StatedScales | None = None


@pydantic_dataclass(frozen=True, config={"extra": "forbid"})
class BackendInfo:
    """Description of a backend. Its name is the one of its entry point.

    Attributes:
        summary: one line for ``robotd backends``.
        api_version: the version of the plugin API that the backend is written for, a literal
            number: ``api_version=1``.
        capabilities: features that are not derived from hooks, see ``Capability``; the methods
            that each needs must exist.
        options: model of its descriptor section.
        axis_keys: keys that commissioning may write; None: scale and direction are not in the
            descriptor.
        linux_capabilities: that its device needs besides those of the control loop, such as
            ``CAP_NET_RAW``; a service unit grants no others.
    """

    summary: str
    api_version: int
    capabilities: frozenset[Capability] = frozenset()
    options: type[BackendOptions] = BackendOptions
    axis_keys: AxisKeys | None = None
    linux_capabilities: tuple[str, ...] = ()


Options = TypeVar("Options")


@dataclass(frozen=True)
class DeviceContext(Generic[Options]):
    """Everything that a backend gets: robot, options and clock.

    Attributes:
        robot: the descriptor, with the variant applied.
        options: result of ``BackendOptions.check_robot``, by default the validated section.
        clock: monotonic time; a backend uses no other.
    """

    robot: RobotDescriptor
    options: Options
    clock: Clock = field(default_factory=MonotonicClock)


class RobotdHooks:
    """The specification; never instantiated."""

    @hookspec
    def robotd_register_robots(self, registry: RobotRegistry) -> None:
        """Add folders of robot descriptors. Called once, before a robot is looked up."""

    @hookspec
    def robotd_register_nodes(self, registry: NodeRegistry) -> None:
        """Add ROS nodes by name, see ``NodeRegistry.add``. Called once, before nodes are made.

        Nodes of a backend are served with every robot on it, besides those of the robot's file;
        they reach its device by ``robot.device``.
        """

    @hookspec(firstresult=True)
    def robotd_backend(self) -> BackendInfo | None:
        """Describe the backend. Called right after the import; must not touch hardware."""

    @hookspec(firstresult=True)
    def robotd_open_device(self, context: DeviceContext[Any]) -> DeviceDriver | None:
        """Make the device driver, not connected yet: ``DeviceDriver.open`` connects."""

    @hookspec(firstresult=True)
    def robotd_axes(self, device: Any, context: DeviceContext[Any]) -> AxisDriver | None:
        """Make the axis driver of the device. Called once per device."""

    @hookspec(firstresult=True)
    def robotd_io(self, device: Any, context: DeviceContext[Any]) -> IoDriver | None:
        """Make the I/O driver of the device; None where this robot has no I/O."""

    @hookspec(firstresult=True)
    def robotd_fieldbus(self, device: Any, context: DeviceContext[Any]) -> FieldbusDriver | None:
        """Make the diagnostics driver of the device; None where there is no fieldbus."""

    @hookspec(firstresult=True)
    def robotd_passive_joints(
        self, device: Any, context: DeviceContext[Any]
    ) -> PassiveJoints | None:
        """Make the reader of measured joints that are not axes; None where there are none."""

    @hookspec(firstresult=True)
    def robotd_payload(self, device: Any, context: DeviceContext[Any]) -> PayloadDriver | None:
        """Make the driver of the payload; None where the device compensates none."""

    @hookspec(firstresult=True)
    def robotd_wrenches(self, device: Any, context: DeviceContext[Any]) -> WrenchDriver | None:
        """Make the reader of forces and torques at links; None where the device has none."""

    @hookspec(firstresult=True)
    def robotd_world(self, device: Any, context: DeviceContext[Any]) -> World | None:
        """Make the surroundings of a simulated robot; None where there are none."""

    @hookspec(firstresult=True)
    def robotd_fault_injector(
        self, device: Any, context: DeviceContext[Any]
    ) -> FaultInjector | None:
        """Make the handle by which tests inject faults and inputs; None where there is none.

        Called by ``robotd_testing``, and for scenarios on a backend that is ``SIMULATED``; never
        while a real robot is served.
        """
