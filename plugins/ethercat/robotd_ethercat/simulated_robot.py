"""Simulated slaves of a robot."""

from __future__ import annotations

import time

from robotd.api import RobotDescriptor, validate_section
from robotd_cia402.options import Identity as IdentityOptions
from robotd_cia402.simulated import DriveModel, Motors
from robotd_cia402.simulated_axis import drive_model, initial_positions, joint_weights
from robotd_ethercat.options import EthercatOptions, IoOptions, SlaveOptions
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


def simulated_line(robot: RobotDescriptor, *, redundant: bool = False) -> Line:
    """Make the slaves of a robot, in bus order; places without options are generic slaves.

    Raises DescriptorError.
    """
    now_ns = time.monotonic_ns()
    options = validate_section(robot, "backends.ethercat", EthercatOptions)
    rated = {joint.axis: joint.rated_effort for joint in robot.joints}
    initial, weights = initial_positions(options.axes, robot), joint_weights(options.axes, robot)
    machine = Motors(initial, now_ns, weights)
    models: dict[int, list[DriveModel]] = {}
    for motor, axis in enumerate(options.axes):
        models.setdefault(axis.slave, []).append(drive_model(motor, axis, rated.get(axis.axis)))
    modules = {module.slave: module for module in options.io}
    first = {axis.slave: axis for axis in reversed(options.axes)}
    slaves: list[Slave] = []
    for number in range(max([*models, *modules], default=-1) + 1):
        if number in models:
            axis = first[number]
            identity = _identity(axis.identity, _DRIVE_PRODUCT, axis)
            alias = axis.alias or 0
            slaves.append(ServoDrive(identity, machine, models[number], now_ns, alias=alias))
        elif number in modules:
            slaves.append(_module(modules[number], now_ns))
        else:
            slaves.append(GenericSlave(now_ns))
    drives = [slave for slave in slaves if isinstance(slave, ServoDrive)]
    return Line(slaves, redundant=redundant, motion=MotionClock(machine, drives))


def _module(module: IoOptions, now_ns: int) -> IoModule:
    identity = _identity(module.identity, _IO_PRODUCT, module)
    sizes = module.input_length, module.output_length
    return IoModule(identity, *sizes, now_ns, alias=module.alias or 0)


def _identity(given: IdentityOptions, product: int, slave: SlaveOptions) -> Identity:
    defaults = VENDOR, product, 1, slave.slave + 1
    parts = (given.vendor_id, given.product_code, given.revision, given.serial)
    return Identity(*[d if one is None else one for one, d in zip(parts, defaults, strict=True)])
