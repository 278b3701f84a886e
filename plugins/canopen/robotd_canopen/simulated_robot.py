"""Simulated network with the nodes of a descriptor section."""

from __future__ import annotations

import time
from collections import defaultdict

import can

from robotd.api import RobotDescriptor
from robotd_canopen.object_dictionary import GENERIC_DRIVE, GENERIC_IO, eds_path
from robotd_canopen.options import AxisOptions, CanopenOptions, Identity
from robotd_canopen.simulated import (
    DriveModel,
    DriveNode,
    IoNode,
    Motors,
    Scale,
    SimulatedNetwork,
    SimulatedNode,
    Switches,
)

_RATED_NM = 100.0  # where the descriptor has no rated torque


def simulated_network(robot: RobotDescriptor, options: CanopenOptions) -> SimulatedNetwork:
    """Make the nodes of the section on a bus of their own, not started."""
    folder = robot.path.parent if robot.path is not None else None
    machine = Motors([0.0] * len(options.axes), time.monotonic_ns())
    rated = {joint.axis: joint.rated_effort for joint in robot.joints}
    by_node: dict[int, list[tuple[int, AxisOptions]]] = defaultdict(list)
    for motor, axis in enumerate(options.axes):
        by_node[axis.node].append((motor, axis))
    nodes: list[SimulatedNode] = []
    for number, axes in by_node.items():
        first = axes[0][1]
        models = [_model(motor, axis, rated.get(axis.axis)) for motor, axis in axes]
        eds = eds_path(first.eds, folder, GENERIC_DRIVE)
        nodes.append(DriveNode(number, eds, machine, models, _identity(first.identity)))
    for module in options.io:
        eds = eds_path(module.eds, folder, GENERIC_IO)
        nodes.append(IoNode(module.node, eds, _identity(module.identity)))
    bus = can.Bus(
        channel=options.bus.channel,
        interface=options.bus.interface,
        bitrate=options.bus.bitrate,
        **options.bus.options,
    )
    priority = max(0, robot.cycle.realtime_priority - 2)  # below the threads that use it
    return SimulatedNetwork(bus, nodes, machine, realtime_priority=priority)


def _model(motor: int, axis: AxisOptions, rated_torque_nm: float | None) -> DriveModel:
    counts = axis.counts_per_rad
    scale = Scale(
        counts,
        axis.velocity_per_rad_s or counts,
        axis.acceleration_per_rad_s2 or counts,
        axis.polarity,
    )
    rated_nm = rated_torque_nm or _RATED_NM
    return DriveModel(motor, scale, axis.axis_offset, rated_nm, _switches(axis))


def _switches(axis: AxisOptions) -> Switches:
    """Convert the switches from the direction of the joint to that of the drive."""
    given = axis.simulated_switches
    ends = given.negative_limit_rad, given.positive_limit_rad
    if axis.polarity > 0:
        return Switches(*ends, given.home_rad, given.home_width_rad)
    low, high, home = (None if one is None else -one for one in (*reversed(ends), given.home_rad))
    return Switches(low, high, home, given.home_width_rad)


def _identity(identity: Identity) -> dict[int, int]:
    parts = (identity.vendor_id, identity.product_code, identity.revision, identity.serial)
    return {sub: value for sub, value in enumerate(parts, 1) if value is not None}
