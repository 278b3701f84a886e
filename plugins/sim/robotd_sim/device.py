"""Device driver: connection to the simulated engine."""

from __future__ import annotations

from pathlib import Path

from robotd.api import (
    NANOSECONDS,
    ConnectError,
    ConnectionState,
    DeviceDriver,
    DeviceTimeout,
    NotReady,
    wait_until,
)
from robotd_sim.alarms import NO_FRAMES
from robotd_sim.simulation import Simulation
from robotd_wmx_parameters import read_wmx_parameters


class SimDevice(DeviceDriver):
    """Opens, starts and stops the engine. Any worker thread may call."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation

    def open(self, path: str = "", name: str = "") -> None:
        """Open the only device, whatever the path or name.

        Raises ConnectError as often as the option ``fail_open`` demands.
        """
        simulation = self.simulation
        delay_ns = round(simulation.options.open_delay_s * NANOSECONDS)
        simulation.clock.sleep_until_ns(simulation.clock.now_ns() + delay_ns)
        with simulation.world.lock:
            simulation.world.advance()
            if simulation.engine is not ConnectionState.IDLE:
                return
            if simulation.failures_left > 0:
                simulation.failures_left -= 1
                reason = (
                    f"device locked by the option fail_open ({simulation.failures_left} more times)"
                )
                raise ConnectError("the simulated device cannot be opened", {"engine": reason})
            simulation.engine, simulation.lost_because = ConnectionState.RUNNING, ""

    def close(self) -> None:
        with self.simulation.world.lock:
            self.simulation.world.advance()
            self.simulation.lost_because = ""
            if self.simulation.engine is not ConnectionState.IDLE:
                self.simulation.reset()

    def start_communication(self, timeout_s: float) -> None:
        simulation = self.simulation
        with simulation.world.lock:
            simulation.world.advance()
            if simulation.engine is ConnectionState.IDLE:
                raise NotReady("communication cannot start: no device is open")
            if simulation.engine is ConnectionState.RUNNING:
                simulation.lost_because = ""
                simulation.request_communication()
        if not self._wait_for(ConnectionState.COMMUNICATING, timeout_s):
            raise DeviceTimeout(f"communication did not start within {timeout_s:g} s")

    def stop_communication(self, timeout_s: float) -> None:
        """Axes brake first, for as long as ``timeout_s`` allows; then the drives go off."""
        simulation = self.simulation
        axes = range(simulation.axes)
        with simulation.world.lock:
            simulation.world.advance()
            for axis in axes:
                simulation.motion.quick_stop(axis)

        def at_rest() -> bool:
            with simulation.world.lock:
                simulation.world.advance()
                return not any(simulation.world.moves(axis) for axis in axes)

        wait_until(at_rest, timeout_s, simulation.clock)
        with simulation.world.lock:
            simulation.silence()

    def state(self) -> ConnectionState:
        simulation = self.simulation
        if simulation.engine is ConnectionState.RUNNING:  # communication may be due to begin
            with simulation.world.lock:
                simulation.world.advance()
        return simulation.engine

    def fault(self) -> str:
        simulation = self.simulation
        silent = simulation.network.is_silent(simulation.world.tick)
        return NO_FRAMES if silent else simulation.lost_because

    def scan_network(self) -> str:
        simulation = self.simulation
        with simulation.world.lock:
            simulation.world.advance()
            if simulation.engine is ConnectionState.IDLE:
                raise NotReady("the network cannot be scanned: no device is open")
            slaves = simulation.network.slaves
            drives = sum(slave.axis is not None for slave in slaves)
            silent = [str(slave.id) for slave in slaves if not slave.connected]
        missing = f"; no answer from {', '.join(silent)}" if silent else ""
        return f"master 0: {drives} drives, {len(slaves) - drives} I/O modules{missing}"

    def load_parameters(self, path: Path) -> str:
        """Raises NotReady while an axis moves, too."""
        axes = self.simulation.axes
        parameters = read_wmx_parameters(path, axes)
        with self.simulation.world.lock:
            self.simulation.world.advance()
            if self.simulation.engine is ConnectionState.IDLE:
                raise NotReady("parameters cannot be loaded: no device is open")
            self.simulation.load(parameters)
        return parameters.missing_summary(axes)

    def dump_parameters(self, axis: int) -> str:
        with self.simulation.world.lock:
            values = self.simulation.parameters.axis(axis)
        return "\n".join(f"{name} = {value:.15g}" for name, value in values.items())

    def _wait_for(self, state: ConnectionState, timeout_s: float) -> bool:
        return wait_until(lambda: self.state() is state, timeout_s, self.simulation.clock)
