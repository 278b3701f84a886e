"""Backend ``feetech``: arms of STS and SMS servos, such as SO-100 and SO-101.

The hooks are here; ``sts_bus`` is the protocol, ``robotd_serial_servo`` everything else.
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
from robotd_feetech.options import FeetechOptions

if TYPE_CHECKING:
    from robotd_serial_servo.device import ServoDevice
    from robotd_serial_servo.options import ServoPlan

WITHOUT_BUS = "The servos have no watchdog: if this computer stops, they hold their last target"


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes and diagnostics."""
    return BackendInfo(
        summary="Feetech STS and SMS servos on a serial port: SO-100, SO-101",
        api_version=1,
        capabilities=frozenset(
            {
                Capability.VELOCITY_MODE,  # by ProfiledAxes
                Capability.HAND_GUIDING,  # with torque off
                Capability.FALLS_WHEN_GUIDED,
                Capability.STATISTICS,
                Capability.DEVICE_WATCHDOG,  # a servo stops at its last goal, which is near
            }
        ),
        options=FeetechOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[ServoPlan]) -> DeviceDriver:
    """Make the device; the port is opened later."""
    from robotd_feetech.sts_bus import StsBus
    from robotd_serial_servo.device import ServoDevice

    return ServoDevice(context.robot, context.options, context.clock, StsBus)


@hookimpl
def robotd_axes(device: ServoDevice, context: DeviceContext[ServoPlan]) -> AxisDriver:
    """One servo for each axis."""
    from robotd_feetech.registers import fault_text
    from robotd_serial_servo.axes import ServoAxes

    return ServoAxes(device, context, fault_text, WITHOUT_BUS)


@hookimpl
def robotd_fieldbus(device: ServoDevice) -> FieldbusDriver:
    """One bus."""
    from robotd_serial_servo.fieldbus import ServoFieldbus

    return ServoFieldbus(device)
