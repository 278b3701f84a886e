"""Simulation backend: a servo engine with dynamics, I/O and a fieldbus, in simulated hardware.

The hooks are here; ``simulation.py`` connects the parts.
"""

from __future__ import annotations

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    FieldbusDriver,
    IoDriver,
    PayloadDriver,
    hookimpl,
)
from robotd_sim.axes import SimAxes
from robotd_sim.device import SimDevice
from robotd_sim.fault_injector import SimFaultInjector
from robotd_sim.fieldbus import SimFieldbus
from robotd_sim.io import SimIo
from robotd_sim.options import SimOptions
from robotd_sim.payload import SimPayload
from robotd_sim.simulation import Simulation

CAPABILITIES = frozenset(
    {
        Capability.VELOCITY_MODE,
        Capability.HAND_GUIDING,
        Capability.HOMING,
        Capability.PARAMETERS_FILE,
        Capability.SCALING,
        Capability.REGISTER_READ,
        Capability.STATISTICS,
        Capability.HOT_CONNECT,
        Capability.OBJECTS,
        Capability.DEVICE_WATCHDOG,
        Capability.SIMULATED,
    }
)


@hookimpl
def robotd_backend() -> BackendInfo:
    """All capabilities but the torque mode; trajectories are streamed."""
    return BackendInfo(
        summary="simulated servo drives and fieldbus, no hardware needed",
        api_version=1,
        capabilities=CAPABILITIES,
        options=SimOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[SimOptions]) -> DeviceDriver:
    """Make a robot at rest, at the initial position of its options."""
    return SimDevice(Simulation(context.robot, context.options, context.clock))


@hookimpl
def robotd_axes(device: SimDevice) -> AxisDriver:
    """One drive per axis."""
    return SimAxes(device.simulation)


@hookimpl
def robotd_io(device: SimDevice) -> IoDriver:
    """Two images, whether or not the robot has an I/O module."""
    return SimIo(device.simulation)


@hookimpl
def robotd_fieldbus(device: SimDevice) -> FieldbusDriver:
    """One EtherCAT line."""
    return SimFieldbus(device.simulation)


@hookimpl
def robotd_payload(device: SimDevice) -> PayloadDriver:
    """Keeps the payload, which changes no motion."""
    return SimPayload(device.simulation)


@hookimpl
def robotd_fault_injector(device: SimDevice) -> FaultInjector:
    """Fault injection into drives, cables and inputs."""
    return SimFaultInjector(device.simulation)
