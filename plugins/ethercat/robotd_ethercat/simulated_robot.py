"""Simulated slaves of a descriptor section."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from robotd.api import RobotDescriptor, load_robot_descriptor, validate_section
from robotd_cia402.options import Identity as IdentityOptions
from robotd_cia402.simulated import Motors
from robotd_cia402.simulated_axis import drive_model, initial_positions
from robotd_ethercat.options import AxisOptions, EthercatOptions, IoOptions, SlaveOptions
from robotd_ethercat.simulated import (
    VENDOR,
    GenericSlave,
    Identity,
    IoModule,
    Line,
    MotionClock,
    ServoDrive,
    Slave,
)

_DRIVE_PRODUCT, _IO_PRODUCT = 0x402, 0x401


@dataclass(frozen=True)
class SimulatedSection:
    """Section ``backends.ethercat`` of a robot, and what else the slaves need of it.

    Attributes:
        name: of the robot.
        options: the section.
        rated_torque_nm: by axis, N·m (or N).
        initial: positions of the motors of ``options.axes`` at power-on, rad (or m).
        priority: real-time priority of the simulation, where it is granted: slaves do not wait
            for the processor.
    """

    name: str
    options: EthercatOptions
    rated_torque_nm: Mapping[int, float | None]
    initial: Sequence[float]
    priority: int = 1

    @classmethod
    def of_robot(cls, robot: RobotDescriptor) -> Self:
        """Return the section of a descriptor. Raises DescriptorError."""
        options = validate_section(robot, "backends.ethercat", EthercatOptions)
        rated = {joint.axis: joint.rated_effort for joint in robot.joints}
        initial = initial_positions(options.axes, robot)
        return cls(robot.name, options, rated, initial, max(1, robot.cycle.realtime_priority - 2))

    @classmethod
    def load(cls, robot: str, variant: str | None) -> Self:
        """Return the section of a robot by name or file. Raises DescriptorError."""
        return cls.of_robot(load_robot_descriptor(robot, variant))

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return a section written by ``to_json``."""
        data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        rated = {int(axis): value for axis, value in data["rated_torque_nm"].items()}
        options = EthercatOptions.model_validate(data["options"])
        return cls(data["name"], options, rated, data["initial"], data.get("priority", 1))

    def to_json(self) -> str:
        """Return the section as text, for a process."""
        return json.dumps(
            {
                "name": self.name,
                "options": self.options.model_dump(mode="json"),
                "rated_torque_nm": dict(self.rated_torque_nm),
                "initial": list(self.initial),
                "priority": self.priority,
            }
        )


def simulated_line(section: SimulatedSection, *, redundant: bool = False) -> Line:
    """Make the slaves of a section, in bus order; places without options are generic slaves."""
    now_ns = time.monotonic_ns()
    options = section.options
    machine = Motors(section.initial, now_ns)
    axes: dict[int, list[tuple[int, AxisOptions]]] = {}
    for motor, axis in enumerate(options.axes):
        axes.setdefault(axis.slave, []).append((motor, axis))
    modules = {module.slave: module for module in options.io}
    slaves: list[Slave] = []
    drives: list[ServoDrive] = []
    for number in range(max([*axes, *modules], default=-1) + 1):
        if number in axes:
            drive = _drive(axes[number], section, machine, now_ns)
            drives.append(drive)
            slaves.append(drive)
        elif number in modules:
            slaves.append(_module(modules[number], now_ns))
        else:
            slaves.append(GenericSlave(now_ns))
    return Line(slaves, redundant=redundant, motion=MotionClock(machine, drives))


def _drive(
    axes: list[tuple[int, AxisOptions]], section: SimulatedSection, machine: Motors, now_ns: int
) -> ServoDrive:
    rated = section.rated_torque_nm
    models = [drive_model(motor, axis, rated.get(axis.axis)) for motor, axis in axes]
    first = axes[0][1]
    identity = _identity(first.identity, _DRIVE_PRODUCT, first)
    return ServoDrive(identity, machine, models, now_ns, alias=first.alias or 0)


def _module(module: IoOptions, now_ns: int) -> IoModule:
    identity = _identity(module.identity, _IO_PRODUCT, module)
    sizes = module.input_length, module.output_length
    return IoModule(identity, *sizes, now_ns, alias=module.alias or 0)


def _identity(given: IdentityOptions, product: int, slave: SlaveOptions) -> Identity:
    defaults = VENDOR, product, 1, slave.slave + 1
    parts = (given.vendor_id, given.product_code, given.revision, given.serial)
    return Identity(*[d if one is None else one for one, d in zip(parts, defaults, strict=True)])
