"""Backend ``dynamixel``: arms of Dynamixel X servos, such as Koch, OMX and ViperX.

The hooks are here; ``dynamixel_bus`` is the protocol, ``robotd_serial_servo`` everything else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FieldbusDriver,
    hookimpl,
)
from robotd_dynamixel.options import DynamixelOptions

if TYPE_CHECKING:
    from robotd_serial_servo.device import ServoDevice
    from robotd_serial_servo.options import ServoPlan

WITHOUT_BUS = (
    "If this computer stops, the servos stop 0.2 s later, and hold their position with torque"
)


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes and diagnostics."""
    return BackendInfo(
        summary="Dynamixel X servos on a serial port: OMX, Koch, ViperX",
        api_version=1,
        capabilities=frozenset(
            {
                Capability.VELOCITY_MODE,  # by ProfiledAxes
                Capability.HAND_GUIDING,  # with torque off
                Capability.FALLS_WHEN_GUIDED,
                Capability.STATISTICS,
                Capability.DEVICE_WATCHDOG,  # the bus watchdog of the servos
            }
        ),
        options=DynamixelOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[ServoPlan]) -> DeviceDriver:
    """Make the device; the port is opened later."""
    from robotd_dynamixel.dynamixel_bus import DynamixelBus
    from robotd_serial_servo.device import ServoDevice

    return ServoDevice(context.robot, context.options, context.clock, DynamixelBus)


@hookimpl
def robotd_axes(device: ServoDevice, context: DeviceContext[ServoPlan]) -> AxisDriver:
    """One servo for each axis."""
    from robotd_dynamixel.registers import fault_text
    from robotd_serial_servo.axes import ServoAxes

    return ServoAxes(device, context, fault_text, WITHOUT_BUS)


@hookimpl
def robotd_fieldbus(device: ServoDevice) -> FieldbusDriver:
    """One bus."""
    from robotd_serial_servo.fieldbus import ServoFieldbus

    return ServoFieldbus(device)
