"""A simulated robot on a fake clock, for the tests of the simulation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from tests.fakes import FakeClock

import robotd_sim
from robotd.api import DeviceContext, Profile
from robotd.arrays import FloatArray
from robotd.descriptor import RobotDescriptor
from robotd.device.process_image import ProcessImage
from robotd_sim.axes import SimAxes
from robotd_sim.device import SimDevice
from robotd_sim.fault_injector import SimFaultInjector
from robotd_sim.options import SimOptions
from robotd_sim.simulation import Simulation

PROFILE = Profile(velocity=2.0, acceleration=8.0, deceleration=4.0)
TICK_S = 0.001
READS_S = 0.4  # between two reads at most
LONG_S = 100.0  # in which the watchdog may act


def robot(axes: int = 2, **keys: Any) -> RobotDescriptor:
    joints = [
        {"name": f"joint{axis + 1}", "axis": axis, "lower_rad": -3.0, "upper_rad": 3.0,
         "velocity_rad_s": 3.0, "acceleration_rad_s2": 10.0, "rated_torque_nm": 20.0}
        for axis in range(axes)
    ]  # fmt: skip
    return RobotDescriptor.model_validate(
        {"schema": 1, "name": "harness", "axes": axes, "joints": joints, **keys}
    )


@dataclass
class Record:
    """Values of each sample, arrays of shape (samples, axes)."""

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    command: FloatArray
    command_velocity: FloatArray
    operation: FloatArray


@dataclass
class Harness:
    clock: FakeClock
    device: SimDevice
    axes: SimAxes
    simulation: Simulation
    image: ProcessImage = field(init=False)

    def __post_init__(self) -> None:
        self.image = ProcessImage(self.simulation.axes)
        self.faults = SimFaultInjector(self.simulation)

    def look(self, seconds: float = 0.0) -> ProcessImage:
        """The image ``seconds`` later."""
        while READS_S < seconds < LONG_S:  # else the watchdog of the device stops moves
            self.clock.advance(READS_S)
            self.axes.read(self.image)
            seconds -= READS_S
        self.clock.advance(seconds)
        self.axes.read(self.image)
        return self.image

    def record(self, seconds: float, sample_s: float = TICK_S) -> Record:
        """Look once per ``sample_s`` for ``seconds``."""
        rows = []
        for _ in range(round(seconds / sample_s)):
            image = self.look(sample_s)
            rows.append([image.position.copy(), image.velocity.copy(),
                         image.position_command.copy(), image.velocity_command.copy(),
                         image.operation.astype(float)])  # fmt: skip
        columns = np.array(rows).transpose(1, 0, 2)
        return Record(np.arange(1, len(rows) + 1) * sample_s, *columns)

    def set(self, **parameters: float) -> None:
        """Change WMX parameters of all axes."""
        axes = range(self.simulation.axes)
        changes = {name: dict.fromkeys(axes, value) for name, value in parameters.items()}
        self.simulation.apply(self.simulation.parameters.with_values(changes))

    def enable(self) -> None:
        for axis in range(self.simulation.axes):
            self.axes.servo(axis, True, 1.0)


def closed_rig(axes: int = 2, descriptor: RobotDescriptor | None = None, **options: Any) -> Harness:
    """Not opened yet."""
    clock = FakeClock()
    context = DeviceContext(descriptor or robot(axes), SimOptions(**options), clock)
    device = robotd_sim.robotd_open_device(context)
    driver = robotd_sim.robotd_axes(device)
    assert isinstance(device, SimDevice)
    assert isinstance(driver, SimAxes)
    return Harness(clock, device, driver, device.simulation)


def harness(axes: int = 2, *, on: bool = True, **options: Any) -> Harness:
    """Communicating, with servos on where ``on``."""
    made = closed_rig(axes, **options)
    made.device.open()
    made.device.start_communication(1.0)
    if on:
        made.enable()
    made.look()
    return made
