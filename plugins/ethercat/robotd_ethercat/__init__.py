"""EtherCAT backend: CiA 402 servo drives and I/O modules over SOEM (pysoem).

The hooks are here; ``master.py`` connects the parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import (
    AxisDriver,
    AxisKeys,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    FieldbusDriver,
    IoDriver,
    hookimpl,
)
from robotd_cia402.drive_scan import stated_scales
from robotd_ethercat.section import EthercatSection

if TYPE_CHECKING:
    from robotd_ethercat.device import EthercatDevice
    from robotd_ethercat.plan import BusPlan

CAPABILITIES = frozenset(
    {
        Capability.VELOCITY_MODE,
        Capability.TORQUE_MODE,
        Capability.HOMING,
        Capability.SCALING,
        Capability.STATISTICS,
        Capability.OBJECTS,
        Capability.REGISTER_READ,
        Capability.DEVICE_WATCHDOG,
    }
)


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes, I/O and diagnostics; no parameter files."""
    return BackendInfo(
        summary="CiA 402 servo drives and I/O modules on EtherCAT, with an open master",
        api_version=1,
        capabilities=CAPABILITIES,
        options=EthercatSection,
        axis_keys=AxisKeys(
            items="axes",
            scale="counts_per_rad",
            polarity="polarity",
            node="slave",
            identity="identity",
            window_object="0x6065",
            stated_scales=lambda read, item: stated_scales(read, item["axis_offset"]),
        ),
    )


@hookimpl
def robotd_open_device(context: DeviceContext[BusPlan]) -> DeviceDriver:
    """Make the device from the bus planned when the options were checked."""
    from robotd_ethercat.device import EthercatDevice
    from robotd_ethercat.master import Master
    from robotd_ethercat.simulation import Simulation
    from robotd_ethercat.soem import Soem

    plan = context.options
    simulation = Simulation(context.robot, plan) if plan.options.simulated else None
    bus = Soem(plan.options.sdo_timeout_s, simulation.run if simulation else None)
    return EthercatDevice(Master(context.robot, plan, bus, context.clock), simulation)


@hookimpl
def robotd_axes(device: EthercatDevice) -> AxisDriver:
    """One axis for each entry of ``axes``."""
    from robotd_cia402.axes import Cia402Axes

    return Cia402Axes(device.master)


@hookimpl
def robotd_io(device: EthercatDevice) -> IoDriver | None:
    """None without modules."""
    from robotd_cia402.module_io import ModuleIo

    master = device.master
    return ModuleIo(master.io) if master.options.io else None


@hookimpl
def robotd_fieldbus(device: EthercatDevice) -> FieldbusDriver:
    """One master."""
    from robotd_ethercat.fieldbus import EthercatFieldbus

    return EthercatFieldbus(device.master)


@hookimpl
def robotd_fault_injector(device: EthercatDevice) -> FaultInjector:
    """Fault injection into simulated slaves."""
    from robotd_ethercat.fault_injector import EthercatFaultInjector

    return EthercatFaultInjector(device.master, device.simulation)
