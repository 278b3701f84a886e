"""Device driver: life cycle of the connection to the bus."""

from __future__ import annotations

from robotd.api import (
    ConnectionState,
    DeviceDriver,
    InvalidArgument,
    NotReady,
    RobotdError,
    get_logger,
)
from robotd_cia402.switch_off import switch_off
from robotd_ethercat.master import Master
from robotd_ethercat.simulation import Simulation

log = get_logger("ethercat")

_IDLE_S = 0.5  # for a stop and for servos, while the control loop may not be running


class EthercatDevice(DeviceDriver):
    """Opens, starts and stops the bus. Any worker thread may call."""

    def __init__(self, master: Master, simulation: Simulation | None) -> None:
        self.master, self.simulation = master, simulation

    def open(self, path: str = "", name: str = "") -> None:
        """Open the configured interface; ``path`` may name no other one, ``name`` is not used."""
        bus_name = self.master.plan.bus_name
        if path and path != bus_name:
            raise InvalidArgument(
                f"the interface is {bus_name!r}, another one ({path!r}) is not configured"
            )
        if self.master.state is not ConnectionState.IDLE:
            return
        if self.simulation is not None:
            self.simulation.start()
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
        """Bring all slaves to Op; after a fault again, with all servos off.

        Raises ConnectError with every slave that fails, its step, its state and AL status.
        """
        if self.master.state is ConnectionState.IDLE:
            raise NotReady("communication cannot start: the interface is not open")
        if self.master.state is not ConnectionState.COMMUNICATING:
            self.master.start()

    def stop_communication(self, timeout_s: float) -> None:
        master = self.master
        if master.state is ConnectionState.IDLE:
            return
        switch_off(master.axes, timeout_s, master.clock)
        try:
            master.end()
        except RobotdError as error:
            log.warning("stopping the bus failed", reason=str(error))

    def state(self) -> ConnectionState:
        return self.master.state

    def fault(self) -> str:
        if self.master.state is not ConnectionState.UNKNOWN:
            return ""
        return self.master.supervision.fault()

    def scan_network(self) -> str:
        """Summarize the configured slaves and those that do not answer."""
        master = self.master
        if master.state is ConnectionState.IDLE:
            raise NotReady("the bus cannot be scanned: the interface is not open")
        found, slaves = len(master.bus.slaves), master.slaves.values()
        drives = sum(slave.is_drive for slave in slaves)
        missing = [slave.name for slave in slaves if slave.number >= found or slave.fault]
        lost = f"; no answer from {', '.join(missing)}" if missing else ""
        return (
            f"EtherCAT on {master.plan.bus_name}: {found} slaves, {drives} configured drives,"
            f" {len(master.slaves) - drives} I/O modules{lost}"
        )

    def _end_simulation(self) -> None:
        if self.simulation is not None:
            self.simulation.stop()
