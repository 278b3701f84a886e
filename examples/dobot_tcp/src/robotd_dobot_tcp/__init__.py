"""The dobot_tcp backend: a Dobot CR controller, which moves all joints of its arm, over TCP.

Read in this order: ``protocol`` (messages), ``link`` (connections), ``device`` (life cycle),
``axes`` (what a whole-arm controller is for robotd), ``io``.
"""

from __future__ import annotations

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    IoDriver,
    hookimpl,
)
from robotd_dobot_tcp.axes import DobotAxes
from robotd_dobot_tcp.device import DobotDevice
from robotd_dobot_tcp.io import DobotIo
from robotd_dobot_tcp.options import DobotOptions


@hookimpl
def robotd_backend() -> BackendInfo:
    """Called right after the import: must not touch hardware."""
    return BackendInfo(
        summary="Dobot CR controllers over TCP",
        api_version=1,
        capabilities=frozenset(
            {
                Capability.VELOCITY_MODE,  # by ProfiledAxes
                Capability.CONTROLLER_ALARM,
                Capability.DEVICE_WATCHDOG,  # the arm stops at the last target
            }
        ),
        options=DobotOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[DobotOptions]) -> DeviceDriver:
    """Make the device, not connected yet."""
    return DobotDevice(context.options, context.clock)


@hookimpl
def robotd_axes(device: DobotDevice, context: DeviceContext[DobotOptions]) -> AxisDriver:
    """Make the axes of the device."""
    return DobotAxes(device, context)


@hookimpl
def robotd_io(device: DobotDevice) -> IoDriver:
    """Make the inputs and outputs of the device."""
    return DobotIo(device)
