"""Backend ``franka``: FR3 and Panda by the Franka Control Interface.

Read in this order: ``arm_link`` (connection, state, impedance controller), ``device`` (life
cycle), ``axes`` (what the arm is for robotd), ``code_tables`` (modes and errors).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    IoDriver,
    PassiveJoints,
    PayloadDriver,
    WrenchDriver,
    hookimpl,
)
from robotd_franka.options import FrankaOptions

if TYPE_CHECKING:
    from robotd_franka.device import FrankaDevice


@hookimpl
def robotd_backend() -> BackendInfo:
    """Axes with one switch and one alarm."""
    return BackendInfo(
        summary="Franka arms by the Franka Control Interface: FR3, Panda",
        api_version=1,
        capabilities=frozenset(
            {
                Capability.VELOCITY_MODE,  # by ProfiledAxes
                Capability.HAND_GUIDING,  # without stiffness
                Capability.CONTROLLER_ALARM,
                Capability.DEVICE_WATCHDOG,  # the impedance controller stays at its last target
            }
        ),
        options=FrankaOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[FrankaOptions]) -> DeviceDriver:
    """Make the device, not connected yet."""
    from robotd_franka.device import FrankaDevice

    return FrankaDevice(context.options, context.clock)


@hookimpl
def robotd_axes(device: FrankaDevice, context: DeviceContext[FrankaOptions]) -> AxisDriver:
    """Make the seven joints."""
    from robotd_franka.axes import FrankaAxes

    return FrankaAxes(device, context)


@hookimpl
def robotd_payload(device: FrankaDevice) -> PayloadDriver:
    """Make the payload of the arm."""
    from robotd_franka.payload import FrankaPayload

    return FrankaPayload(device)


@hookimpl
def robotd_io(device: FrankaDevice) -> IoDriver | None:
    """Return the hand, which an output closes; None where the arm has none."""
    return device.hand


@hookimpl
def robotd_passive_joints(device: FrankaDevice) -> PassiveJoints | None:
    """Return the hand, which measures its fingers; None where the arm has none."""
    return device.hand


@hookimpl
def robotd_wrenches(
    device: FrankaDevice, context: DeviceContext[FrankaOptions]
) -> WrenchDriver | None:
    """Return the estimate of the external wrench; None without a URDF."""
    from robotd_franka.wrench import FrankaWrenches, last_link

    link = last_link(context.robot)
    return FrankaWrenches(device, link) if link is not None else None
