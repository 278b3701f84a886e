"""Device driver: life cycle of the connection to the bus."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from robotd.api import (
    ConnectionState,
    DeviceDriver,
    InvalidArgument,
    NotReady,
    RobotdError,
    RobotDescriptor,
    get_logger,
)
from robotd_canopen.bus import Bus
from robotd_canopen.master import Master
from robotd_canopen.nmt import NmtCommand
from robotd_canopen.node import Node
from robotd_canopen.simulated import SimulatedNetwork
from robotd_canopen.simulated_robot import simulated_network
from robotd_cia402.switch_off import switch_off

log = get_logger("canopen")

_IDLE_S = 0.5  # for a stop, while the control loop may not be running


class CanopenDevice(DeviceDriver):
    """Opens, starts and stops the network. Any worker thread may call."""

    def __init__(self, robot: RobotDescriptor, master: Master) -> None:
        self.master = master
        self._robot = robot
        self._simulation: SimulatedNetwork | None = None

    def open(self, path: str = "", name: str = "") -> None:
        """Open the configured bus; ``path`` may name no other one, ``name`` is not used."""
        if path and path != self.master.bus.name:
            raise InvalidArgument(
                f"the bus is {self.master.bus.name!r}, another one ({path!r}) is not configured"
            )
        if self.master.state is not ConnectionState.IDLE:
            return
        self._simulate()
        try:
            self.master.open()
        except RobotdError:
            self._end_simulation()
            raise

    def close(self) -> None:
        if self.master.state in (ConnectionState.COMMUNICATING, ConnectionState.UNKNOWN):
            self.stop_communication(_IDLE_S)
        self.master.close()
        self._end_simulation()

    def start_communication(self, timeout_s: float) -> None:
        """Configure and start nodes; after a fault only those that were lost.

        Raises ConnectError with every node that fails, its step, object and abort code.
        """
        if self.master.state is ConnectionState.IDLE:
            raise NotReady("communication cannot start: the bus is not open")
        if self.master.state is not ConnectionState.COMMUNICATING:
            self.master.start(timeout_s)

    def stop_communication(self, timeout_s: float) -> None:
        """Also of nodes that a start which failed for others has started."""
        master = self.master
        if master.state is ConnectionState.IDLE:
            return
        switch_off(master.axes, timeout_s, master.clock)
        online = [node for node in master.nodes.values() if node.online]
        master.end()  # stop supervision: missing heartbeats are expected now
        for node in online:
            self._try(node, partial(node.watch_master, watch=False))
            self._try(node, partial(node.command, NmtCommand.PRE_OPERATIONAL))

    def state(self) -> ConnectionState:
        return self.master.state

    def fault(self) -> str:
        return self.master.supervision.fault()

    def scan_network(self) -> str:
        """Summarize the configured nodes and those that did not answer."""
        if self.master.state is ConnectionState.IDLE:
            raise NotReady("the network cannot be scanned: the bus is not open")
        nodes = self.master.nodes.values()
        drives = {axis.node.id for axis in self.master.axes}
        silent = [node.name for node in nodes if not node.identity]
        missing = f"; no answer from {', '.join(silent)}" if silent else ""
        return (
            f"CANopen on {self.master.bus.name}: {len(drives)} drives,"
            f" {len(self.master.nodes) - len(drives)} I/O modules,"
            f" computed bus load {self.master.layout.bus_load:.0%}{missing}"
        )

    @property
    def simulation(self) -> SimulatedNetwork | None:
        """Simulated nodes in this process; None without them."""
        return self._simulation

    @property
    def bus(self) -> Bus:
        return self.master.bus

    def _simulate(self) -> None:
        if self.master.options.simulated and self._simulation is None:
            self._simulation = simulated_network(self._robot, self.master.options)
            self._simulation.start()

    def _end_simulation(self) -> None:
        if self._simulation is not None:
            self._simulation.stop()
            self._simulation = None

    @staticmethod
    def _try(node: Node, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # noqa: BLE001 - the other nodes are stopped all the same
            log.warning("stopping a node failed", node=node.name, reason=str(error))
