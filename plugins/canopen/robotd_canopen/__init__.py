"""CANopen backend: CiA 402 servo drives and CiA 401 I/O modules over python-can.

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
from robotd_canopen.section import CanopenSection
from robotd_cia402.drive_scan import stated_scales

if TYPE_CHECKING:
    from robotd_canopen.device import CanopenDevice
    from robotd_canopen.layout import NetworkLayout

CAPABILITIES = frozenset(
    {
        Capability.VELOCITY_MODE,
        Capability.TORQUE_MODE,
        Capability.HOMING,
        Capability.SCALING,
        Capability.STATISTICS,
        Capability.OBJECTS,
        Capability.DEVICE_WATCHDOG,
    }
)


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes, I/O and diagnostics; no parameter files, registers or hot connect."""
    return BackendInfo(
        summary="CiA 402 servo drives and CiA 401 I/O modules on a CAN bus",
        api_version=1,
        capabilities=CAPABILITIES,
        options=CanopenSection,
        axis_keys=AxisKeys(
            items="axes",
            scale="counts_per_rad",
            polarity="polarity",
            node="node",
            identity="identity",
            window_object="0x6065",
            stated_scales=lambda read, item: stated_scales(read, item["axis_offset"]),
        ),
    )


@hookimpl
def robotd_open_device(context: DeviceContext[NetworkLayout]) -> DeviceDriver:
    """Make the device from the network planned when the options were checked."""
    from robotd_canopen.device import CanopenDevice
    from robotd_canopen.master import Master

    return CanopenDevice(context.robot, Master(context.robot, context.options, context.clock))


@hookimpl
def robotd_axes(device: CanopenDevice) -> AxisDriver:
    """One axis for each entry of ``axes``."""
    from robotd_canopen.canopen_axis import CanopenAxes

    master = device.master
    return CanopenAxes(master.axes, master.feedback, master)


@hookimpl
def robotd_io(device: CanopenDevice) -> IoDriver | None:
    """None without modules."""
    from robotd_cia402.module_io import ModuleIo

    master = device.master
    return ModuleIo(master.io) if master.options.io else None


@hookimpl
def robotd_fieldbus(device: CanopenDevice) -> FieldbusDriver:
    """One master."""
    from robotd_canopen.fieldbus import CanopenFieldbus

    return CanopenFieldbus(device.master)


@hookimpl
def robotd_fault_injector(device: CanopenDevice) -> FaultInjector:
    """Fault injection into simulated drives."""
    from robotd_canopen.fault_injector import CanopenFaultInjector

    return CanopenFaultInjector(device)
