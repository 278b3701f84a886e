"""Simulation backend: a servo engine with dynamics, I/O and a fieldbus, in simulated hardware.

The hooks are here; ``simulation.py`` shows how the parts belong together.
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
from robotd_sim.axes import SimAxes
from robotd_sim.device import SimDevice
from robotd_sim.fault_injector import SimBench
from robotd_sim.fieldbus import SimFieldbus
from robotd_sim.io import SimIo
from robotd_sim.options import SimOptions
from robotd_sim.simulation import Simulation

CAPABILITIES = frozenset(Capability) - {
    Capability.TORQUE_MODE,
    Capability.TRAJECTORIES_ON_DEVICE,
}


@hookimpl
def robotd_backend() -> BackendInfo:
    """All capabilities but the torque mode; trajectories are streamed."""
    return BackendInfo(
        name="sim",
        summary="simulated servo drives and fieldbus, no hardware needed",
        capabilities=CAPABILITIES,
        options=SimOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext) -> DeviceDriver:
    """A robot of its own, at rest where its options put it."""
    return SimDevice(Simulation(context.robot, cast(SimOptions, context.options), context.clock))


@hookimpl
def robotd_axes(device: DeviceDriver) -> AxisDriver:
    """One drive per axis."""
    return SimAxes(cast(SimDevice, device).simulation)


@hookimpl
def robotd_io(device: DeviceDriver) -> IoDriver:
    """Two images, whether or not the robot has an I/O module."""
    return SimIo(cast(SimDevice, device).simulation)


@hookimpl
def robotd_fieldbus(device: DeviceDriver) -> FieldbusDriver:
    """One EtherCAT line."""
    return SimFieldbus(cast(SimDevice, device).simulation)


@hookimpl
def robotd_fault_injector(device: DeviceDriver) -> FaultInjector:
    """Hands, plugs and sensors."""
    return SimBench(cast(SimDevice, device).simulation)
