"""CANopen backend: CiA 402 servo drives and CiA 401 I/O modules over python-can.

The hooks are here; ``master.py`` connects the parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robotd.api import (
    BackendInfo,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    RobotDescriptor,
    hookimpl,
)
from robotd_canopen.options import CanopenOptions
from robotd_cia402.hooks import backend_info, robotd_axes, robotd_fieldbus, robotd_io

if TYPE_CHECKING:
    from robotd_canopen.layout import NetworkLayout
    from robotd_cia402.device import Cia402Device

__all__ = [
    "robotd_axes",
    "robotd_backend",
    "robotd_fault_injector",
    "robotd_fieldbus",
    "robotd_io",
    "robotd_open_device",
]


class CanopenSection(CanopenOptions):
    """The section ``backends.canopen``, from which the network is planned."""

    def check_robot(self, robot: RobotDescriptor) -> NetworkLayout:
        """Plan the network, which takes the robot and the EDS files. Raises DescriptorError."""
        from robotd_canopen.layout import plan_network

        return plan_network(robot, self)


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes, I/O and diagnostics; no parameter files, registers or hot connect."""
    summary = "CiA 402 servo drives and CiA 401 I/O modules on a CAN bus"
    return backend_info(summary, CanopenSection, "node")


@hookimpl
def robotd_open_device(context: DeviceContext[NetworkLayout]) -> DeviceDriver:
    """Make the device from the network planned when the options were checked."""
    from robotd_canopen.fieldbus import CanopenFieldbus
    from robotd_canopen.master import Master
    from robotd_canopen.simulated_robot import Simulation
    from robotd_cia402.device import Cia402Device

    robot, options = context.robot, context.options.options
    master = Master(robot, context.options, context.clock)
    simulation = Simulation(robot, options) if options.simulated else None
    return Cia402Device(master, CanopenFieldbus(master), simulation)


@hookimpl
def robotd_fault_injector(device: Cia402Device[Any, Any]) -> FaultInjector:
    """Fault injection into simulated drives."""
    from robotd_cia402.fault_injector import Cia402FaultInjector

    return Cia402FaultInjector(
        device, disconnect="silence", reconnect="silence 0", freeze="all drop"
    )
