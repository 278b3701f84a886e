"""Backend ``dobot``: a Dobot CR, Nova or E6 arm on its own controller, over TCP.

Read in this order: ``protocol`` (messages), ``command_port`` and ``link`` (connections),
``device`` (life cycle), ``axes`` (what a whole-arm controller is for robotd), ``io``.
"""

from __future__ import annotations

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    IoDriver,
    PayloadDriver,
    hookimpl,
)
from robotd_dobot.axes import DobotAxes
from robotd_dobot.device import DobotDevice
from robotd_dobot.io import DobotIo
from robotd_dobot.options import DobotOptions
from robotd_dobot.payload import DobotPayload


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes and digital terminals."""
    return BackendInfo(
        summary="Dobot CR, Nova and E6 arms on their own controller, over TCP",
        api_version=1,
        capabilities=frozenset(
            {
                Capability.VELOCITY_MODE,  # by ProfiledAxes
                Capability.HAND_GUIDING,  # the controller's drag mode
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
def robotd_payload(device: DobotDevice) -> PayloadDriver:
    """Make the payload of the arm."""
    return DobotPayload(device)


@hookimpl
def robotd_io(device: DobotDevice) -> IoDriver:
    """Make the inputs and outputs of the device."""
    return DobotIo(device)
