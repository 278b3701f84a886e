"""The hooks of the WMX backend."""

from __future__ import annotations

from typing import cast

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
from robotd_wmx.connection import Connection
from robotd_wmx.device import WmxDevice
from robotd_wmx.fieldbus import WmxFieldbus
from robotd_wmx.io import WmxIo
from robotd_wmx.options import WmxOptions

CAPABILITIES = frozenset(Capability) - {Capability.TORQUE_MODE, Capability.SIMULATED}


@hookimpl
def robotd_backend() -> BackendInfo:
    """All capabilities but the torque mode; trajectories run as splines on the engine."""
    return BackendInfo(
        name="wmx",
        summary="WMX3 motion engine with its EtherCAT master",
        capabilities=CAPABILITIES,
        options=WmxOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext) -> DeviceDriver:
    """The engine, not started yet."""
    options = cast(WmxOptions, context.options)
    return WmxDevice(Connection(context.robot, options, context.clock))


@hookimpl
def robotd_axes(device: DeviceDriver, context: DeviceContext) -> AxisDriver:
    """The first axes of the engine, numbered as the engine does."""
    return WmxAxes(cast(WmxDevice, device).connection)


@hookimpl
def robotd_io(device: DeviceDriver, context: DeviceContext) -> IoDriver:
    """The engine's two images."""
    return WmxIo(cast(WmxDevice, device).connection)


@hookimpl
def robotd_fieldbus(device: DeviceDriver, context: DeviceContext) -> FieldbusDriver:
    """The engine's EtherCAT masters."""
    return WmxFieldbus(cast(WmxDevice, device).connection)
