"""The hooks of the WMX backend."""

from __future__ import annotations

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FieldbusDriver,
    IoDriver,
    hookimpl,
)
from robotd_wmx.axes import WmxAxes
from robotd_wmx.connection import WmxConnection
from robotd_wmx.device import WmxDevice
from robotd_wmx.fieldbus import WmxFieldbus
from robotd_wmx.io import WmxIo
from robotd_wmx.options import WmxOptions

CAPABILITIES = frozenset(
    {
        Capability.VELOCITY_MODE,
        Capability.HOMING,
        Capability.PARAMETERS_FILE,
        Capability.SCALING,
        Capability.REGISTER_READ,
        Capability.STATISTICS,
        Capability.HOT_CONNECT,
        Capability.OBJECTS,
        Capability.TRAJECTORIES_ON_DEVICE,
        Capability.DEVICE_WATCHDOG,
    }
)


@hookimpl
def robotd_backend() -> BackendInfo:
    """All capabilities but the torque mode; trajectories run as splines on the engine."""
    return BackendInfo(
        summary="WMX3 motion engine with its EtherCAT master",
        api_version=1,
        capabilities=CAPABILITIES,
        options=WmxOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[WmxOptions]) -> DeviceDriver:
    """The engine, not started yet."""
    return WmxDevice(WmxConnection(context.robot, context.options, context.clock))


@hookimpl
def robotd_axes(device: WmxDevice) -> AxisDriver:
    """The first axes of the engine, numbered as the engine does."""
    return WmxAxes(device.connection)


@hookimpl
def robotd_io(device: WmxDevice) -> IoDriver:
    """The engine's two images."""
    return WmxIo(device.connection)


@hookimpl
def robotd_fieldbus(device: WmxDevice) -> FieldbusDriver:
    """The engine's EtherCAT masters."""
    return WmxFieldbus(device.connection)
