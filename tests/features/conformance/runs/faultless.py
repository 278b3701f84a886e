"""Backends without a fault that lack what the checks could take for granted."""

from __future__ import annotations

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FieldbusDriver,
    IoDriver,
    hookimpl,
)
from robotd_sim import CAPABILITIES, SimAxes, SimDevice, SimOptions, Simulation

ABOUT_BUSES = frozenset({
    Capability.REGISTER_READ, Capability.STATISTICS, Capability.HOT_CONNECT, Capability.OBJECTS,
})  # fmt: skip


class AxesAlone:
    """The simulation without I/O, fieldbus and fault injector."""

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        return BackendInfo("axes alone", 1, CAPABILITIES - ABOUT_BUSES, SimOptions)

    @hookimpl
    def robotd_open_device(self, context: DeviceContext[SimOptions]) -> DeviceDriver:
        return SimDevice(Simulation(context.robot, context.options, context.clock))

    @hookimpl
    def robotd_axes(self, device: SimDevice) -> SimAxes:
        return SimAxes(device.simulation)


class PositionsAlone(Mutant):
    """No capability but that of being simulated."""

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        simulated = frozenset({Capability.SIMULATED})
        return BackendInfo("positions alone", 1, simulated, SimOptions)

    @hookimpl
    def robotd_io(self, device: SimDevice) -> IoDriver | None:  # type: ignore[override]
        return None

    @hookimpl
    def robotd_fieldbus(self, device: SimDevice) -> FieldbusDriver | None:  # type: ignore[override]
        return None


class ReadOnly(Mutant):
    """A device that is only observed."""

    class Axes(SimAxes):
        @property
        def read_only(self) -> str:
            return "the controller's own program moves the axes"
