"""EtherCAT backend: CiA 402 servo drives and I/O modules over SOEM (pysoem).

The hooks are here; ``master.py`` connects the parts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from robotd.api import (
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    RobotDescriptor,
    hookimpl,
)
from robotd_cia402.hooks import backend_info, robotd_axes, robotd_fieldbus, robotd_io
from robotd_ethercat.options import EthercatOptions

if TYPE_CHECKING:
    from robotd_cia402.device import Cia402Device
    from robotd_ethercat.plan import BusPlan

__all__ = [
    "robotd_axes",
    "robotd_backend",
    "robotd_fault_injector",
    "robotd_fieldbus",
    "robotd_io",
    "robotd_open_device",
]


class EthercatSection(EthercatOptions):
    """The section ``backends.ethercat``, from which the bus is planned."""

    def check_robot(self, robot: RobotDescriptor) -> BusPlan:
        """Plan the bus. Raises DescriptorError with every problem."""
        from robotd_ethercat.plan import plan_bus

        return plan_bus(robot, self)


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes, I/O and diagnostics; no parameter files."""
    summary = "CiA 402 servo drives and I/O modules on EtherCAT, with an open master"
    info = backend_info(summary, EthercatSection, "slave", Capability.REGISTER_READ)
    return replace(info, linux_capabilities=("CAP_NET_RAW",))  # of its socket


@hookimpl
def robotd_open_device(context: DeviceContext[BusPlan]) -> DeviceDriver:
    """Make the device from the bus planned when the options were checked."""
    from robotd_cia402.device import Cia402Device
    from robotd_ethercat.fieldbus import EthercatFieldbus
    from robotd_ethercat.master import Master
    from robotd_ethercat.slaves_process import Simulation
    from robotd_ethercat.soem import Soem

    plan = context.options
    simulation = Simulation(context.robot, plan) if plan.options.simulated else None
    bus = Soem(plan.options.sdo_timeout_s, simulation.run if simulation else None)
    master = Master(context.robot, plan, bus, context.clock)
    return Cia402Device(master, EthercatFieldbus(master), simulation)


@hookimpl
def robotd_fault_injector(device: Cia402Device[Any, Any]) -> FaultInjector:
    """Fault injection into simulated slaves."""
    from robotd_cia402.fault_injector import Cia402FaultInjector

    return Cia402FaultInjector(
        device, disconnect="cut", reconnect="join", freeze="0 loss", in_line=True
    )
