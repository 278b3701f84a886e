"""Simulated network with the nodes of a descriptor section."""

from __future__ import annotations

import time
from collections import defaultdict

import can

from robotd.api import ConnectError, RobotDescriptor
from robotd_canopen.fault_commands import inject
from robotd_canopen.object_dictionary import GENERIC_DRIVE, GENERIC_IO, eds_path
from robotd_canopen.options import AxisOptions, CanopenOptions
from robotd_canopen.simulated import DriveNode, IoNode, SimulatedNetwork, SimulatedNode
from robotd_cia402.options import Identity
from robotd_cia402.simulated import Motors
from robotd_cia402.simulated_axis import drive_model, initial_positions


class Simulation:
    """The robot's nodes in this process, for the option ``simulated``. Worker threads."""

    def __init__(self, robot: RobotDescriptor, options: CanopenOptions) -> None:
        self._robot, self._options = robot, options
        self._network: SimulatedNetwork | None = None

    def start(self) -> None:
        """Power on; no effect on a running network."""
        if self._network is None:
            self._network = simulated_network(self._robot, self._options)
            self._network.start()

    def stop(self) -> None:
        """Power off. Twice is not an error."""
        network, self._network = self._network, None
        if network is not None:
            network.stop()

    def inject(self, line: str) -> str:
        """Inject a fault. Raises ConnectError while powered off, ValueError."""
        answer = inject(self.network, line)
        if answer.startswith("not understood"):
            raise ValueError(answer)
        return answer

    @property
    def network(self) -> SimulatedNetwork:
        """Raises ConnectError while powered off."""
        if self._network is None:
            raise ConnectError("the simulated nodes are not running")
        return self._network


def simulated_network(robot: RobotDescriptor, options: CanopenOptions) -> SimulatedNetwork:
    """Make the nodes of the section on a bus of their own, not started."""
    folder = robot.path.parent if robot.path is not None else None
    machine = Motors(initial_positions(options.axes, robot), time.monotonic_ns())
    rated = {joint.axis: joint.rated_effort for joint in robot.joints}
    by_node: dict[int, list[tuple[int, AxisOptions]]] = defaultdict(list)
    for motor, axis in enumerate(options.axes):
        by_node[axis.node].append((motor, axis))
    nodes: list[SimulatedNode] = []
    for number, axes in by_node.items():
        first = axes[0][1]
        models = [drive_model(motor, axis, rated.get(axis.axis)) for motor, axis in axes]
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


def _identity(identity: Identity) -> dict[int, int]:
    parts = (identity.vendor_id, identity.product_code, identity.revision, identity.serial)
    return {sub: value for sub, value in enumerate(parts, 1) if value is not None}
