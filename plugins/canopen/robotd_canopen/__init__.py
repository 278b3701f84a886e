"""CANopen backend: CiA 402 servo drives and CiA 401 I/O modules on any bus of python-can.

The hooks are here; ``master.py`` shows how the parts belong together.
"""

from __future__ import annotations

from typing import cast

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    FieldbusDriver,
    IoDriver,
    hookimpl,
)
from robotd_canopen.options import CanopenOptions

CAPABILITIES = frozenset(
    {
        Capability.AXES,
        Capability.IO,
        Capability.FIELDBUS,
        Capability.VELOCITY_MODE,
        Capability.HOMING,
        Capability.SCALING,
        Capability.STATISTICS,
        Capability.DEVICE_WATCHDOG,
    }
)


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes, I/O and diagnostics; no parameter files, registers or hot connect."""
    return BackendInfo(
        name="canopen",
        summary="CiA 402 servo drives and CiA 401 I/O modules on a CAN bus",
        capabilities=CAPABILITIES,
        options=CanopenOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext) -> DeviceDriver:
    """The network of the descriptor. Raises DescriptorError with all that is wrong in it."""
    from robotd_canopen.device import CanopenDevice
    from robotd_canopen.master import Master

    options = cast(CanopenOptions, context.options)
    return CanopenDevice(context.robot, Master(context.robot, options, context.clock))


@hookimpl
def robotd_axes(device: DeviceDriver) -> AxisDriver:
    """One axis for each entry of ``axes``."""
    from robotd_canopen.axes import CanopenAxes
    from robotd_canopen.device import CanopenDevice

    return CanopenAxes(cast(CanopenDevice, device).master)


@hookimpl
def robotd_io(device: DeviceDriver) -> IoDriver | None:
    """None without modules."""
    from robotd_canopen.device import CanopenDevice
    from robotd_canopen.io import CanopenIo

    master = cast(CanopenDevice, device).master
    return CanopenIo(master) if master.options.io else None


@hookimpl
def robotd_fieldbus(device: DeviceDriver) -> FieldbusDriver:
    """One master."""
    from robotd_canopen.device import CanopenDevice
    from robotd_canopen.fieldbus import CanopenFieldbus

    return CanopenFieldbus(cast(CanopenDevice, device).master)


@hookimpl
def robotd_fault_injector(device: DeviceDriver) -> FaultInjector:
    """The world around simulated drives."""
    from robotd_canopen.device import CanopenDevice
    from robotd_canopen.fault_injector import CanopenBench

    return CanopenBench(cast(CanopenDevice, device))
