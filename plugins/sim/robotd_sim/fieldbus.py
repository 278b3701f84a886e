"""Diagnostics of the simulated line."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from robotd.api import (
    BusStatus,
    ConnectionState,
    FieldbusDriver,
    InvalidArgument,
    NotReady,
    OperationError,
)
from robotd_sim.network import Slave
from robotd_sim.simulation import Simulation
from robotd_sim.slave_controller import MEMORY_BYTES, memory

if TYPE_CHECKING:
    from robotd_sim.slave_objects import SlaveObjects


class SimFieldbus(FieldbusDriver):
    """One master, id 0."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    @property
    def buses(self) -> int:
        return 1

    @property
    def register_bytes(self) -> int:
        return MEMORY_BYTES

    def status(self, bus: int) -> BusStatus:
        self._check_bus(bus)
        simulation, world = self._simulation, self._simulation.world
        with world.lock:
            world.advance()
            return simulation.network.state(
                world.tick, world.slips, communicating=simulation.communicating
            )

    def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
        slave, simulation = self._slave(bus, node), self._simulation
        if address < 0 or length < 1 or address + length > MEMORY_BYTES:
            raise InvalidArgument(
                f"registers 0x{address:X} to 0x{address + length - 1:X} are outside of"
                f" 0x000 to 0x{MEMORY_BYTES - 1:X}"
            )
        with simulation.world.lock:
            self._require_answer(slave)
            image = memory(
                slave,
                communicating=simulation.communicating,
                last=slave is simulation.network.slaves[-1],
                system_time_ns=simulation.world.now_ns,
            )
        return image[address : address + length]

    def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
        slave = self._slave(bus, node)
        with self._simulation.world.lock:
            self._require_answer(slave)
            return self._objects.read(slave, index, subindex)

    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        slave = self._slave(bus, node)
        with self._simulation.world.lock:
            self._require_answer(slave)
            self._objects.write(slave, index, subindex, data)

    @cached_property
    def _objects(self) -> SlaveObjects:
        """Imported at the first use: a start needs none of it."""
        from robotd_sim.slave_objects import SlaveObjects

        return SlaveObjects(self._simulation)

    def reset_statistics(self, bus: int) -> None:
        self._check_bus(bus)
        world = self._simulation.world
        with world.lock:
            world.advance()
            self._simulation.network.reset(world.tick, world.slips)

    def start_hot_connect(self, bus: int) -> None:
        """Offline slaves are back after ``hot_connect_delay_s``; their drives stay off."""
        self._check_bus(bus)
        simulation = self._simulation
        with simulation.world.lock:
            simulation.world.advance()
            self._require_open()
            delay = simulation.options.ticks(simulation.options.hot_connect_delay_s)
            simulation.world.at(simulation.world.tick + delay, simulation.reconnect)

    def _slave(self, bus: int, node: int) -> Slave:
        self._check_bus(bus)
        slaves = self._simulation.network.slaves
        if not 0 <= node < len(slaves):
            raise InvalidArgument(f"slave {node} does not exist, slaves are 0 to {len(slaves) - 1}")
        return slaves[node]

    def _require_answer(self, slave: Slave) -> None:
        """Raise NotReady or OperationError unless the slave answers now; under the lock."""
        self._simulation.world.advance()
        self._require_open()
        if not slave.connected:
            raise OperationError(f"slave {slave.id} on master 0 does not answer")

    def _require_open(self) -> None:
        if self._simulation.engine is ConnectionState.IDLE:
            raise NotReady("the fieldbus cannot be read: no device is open")

    @staticmethod
    def _check_bus(bus: int) -> None:
        if bus != 0:
            raise InvalidArgument(f"master {bus} does not exist, there is only master 0")
