"""The simulation as a plugin whose drivers can be exchanged; and axes that can be changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

import robotd_sim
from robotd.api import (
    BackendInfo,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    FloatArray,
    PayloadDriver,
    ProcessImage,
    WrenchDriver,
    hookimpl,
)
from robotd_sim import (
    SimAxes,
    SimDevice,
    SimFaultInjector,
    SimFieldbus,
    SimIo,
    SimOptions,
    SimPayload,
    Simulation,
)


class SimWrenches(WrenchDriver):
    """A force of 0 at the wrist, which the simulation itself does not have."""

    links: Sequence[str] = ("link6",)

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def read(self, wrenches: FloatArray) -> int:
        world = self._simulation.world
        wrenches[:] = 0.0 if self._simulation.communicating else np.nan
        return world.now_ns


class Mutant:
    """The simulation as a plugin whose drivers can be exchanged.

    Attributes:
        breaks: clause of the driver contract (``clauses.yaml``), and kind of fault.
        found_by: check, or checks, that must fail on it; "": no check finds it yet.
        says: regular expression that the failure matches.
        robot: on which it is found; None: that of the kit.
        only: parameters of the checks that find it, ``move-quick_stop``; "": each set of them.
    """

    breaks: ClassVar[tuple[str, str]]
    found_by: ClassVar[str | tuple[str, ...]] = ""
    says: ClassVar[str] = ""
    robot: ClassVar[str | None] = None
    only: ClassVar[str] = ""
    Device: ClassVar[type[SimDevice]] = SimDevice
    Axes: ClassVar[type[SimAxes]] = SimAxes
    Io: ClassVar[type[SimIo]] = SimIo
    Fieldbus: ClassVar[type[SimFieldbus]] = SimFieldbus
    ArmPayload: ClassVar[type[SimPayload]] = SimPayload
    Wrenches: ClassVar[type[SimWrenches] | None] = None
    Injector: ClassVar[type[SimFaultInjector]] = SimFaultInjector

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        return BackendInfo(
            summary="a mutant",
            api_version=1,
            capabilities=robotd_sim.CAPABILITIES,
            options=SimOptions,
        )

    @hookimpl
    def robotd_open_device(self, context: DeviceContext[SimOptions]) -> DeviceDriver:
        return self.Device(Simulation(context.robot, context.options, context.clock))

    @hookimpl
    def robotd_axes(self, device: SimDevice) -> SimAxes:
        return self.Axes(device.simulation)

    @hookimpl
    def robotd_io(self, device: SimDevice) -> SimIo:
        return self.Io(device.simulation)

    @hookimpl
    def robotd_fieldbus(self, device: SimDevice) -> SimFieldbus:
        return self.Fieldbus(device.simulation)

    @hookimpl
    def robotd_payload(self, device: SimDevice) -> PayloadDriver:
        return self.ArmPayload(device.simulation)

    @hookimpl
    def robotd_wrenches(self, device: SimDevice) -> WrenchDriver | None:
        return None if self.Wrenches is None else self.Wrenches(device.simulation)

    @hookimpl
    def robotd_fault_injector(self, device: SimDevice) -> FaultInjector:
        return self.Injector(device.simulation)


class ReadAnew(SimAxes):
    """Axes that write the whole image at each read, so that a mutant may change it."""

    def read(self, image: ProcessImage) -> None:
        self._readout._image = None
        super().read(image)
