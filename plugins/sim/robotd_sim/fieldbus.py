"""Diagnostics of the simulated line."""

from __future__ import annotations

import struct
from functools import cached_property
from typing import TYPE_CHECKING

from robotd.api import (
    BusState,
    BusStatus,
    ConnectionState,
    FieldbusDriver,
    InvalidArgument,
    NotReady,
    OperationError,
)
from robotd_sim.network import Slave
from robotd_sim.simulation import Simulation

if TYPE_CHECKING:
    from robotd_sim.slave_objects import SlaveObjects

MEMORY_BYTES = 0x1000

# Register addresses and bits as in the public register descriptions of EtherCAT slave controllers
# (ETG.1000.4 and vendors' data sheets). AL states have the controller's own numbers there.
_ESC_STATE = {
    BusState.UNKNOWN: 0x00,
    BusState.CONFIGURABLE: 0x02,  # Preop
    BusState.OPERATIONAL: 0x08,  # Op
}

_TYPE, _REVISION, _BUILD = 0x11, 0x02, 0x0001
_FMMUS = _SYNC_MANAGERS = 8
_RAM_KIB = 8
_PORTS_0_AND_1_MII = 0x0F
_FEATURES_DC_64_BIT = 0x000C
_WATCHDOG_DIVIDER, _WATCHDOG_PERIODS = 0x09C2, 0x03E8  # power-on values: 100 µs, 100 ms


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


def memory(slave: Slave, *, communicating: bool, last: bool, system_time_ns: int) -> bytes:
    """The registers of ``slave``; ``last`` is the one at the end of the line."""
    image = bytearray(MEMORY_BYTES)
    state = _ESC_STATE[slave.state(communicating=communicating)]

    def put(address: int, layout: str, *values: int) -> None:
        struct.pack_into("<" + layout, image, address, *values)

    put(0x0000, "BBHBBBBH", _TYPE, _REVISION, _BUILD, _FMMUS, _SYNC_MANAGERS, _RAM_KIB,
        _PORTS_0_AND_1_MII, _FEATURES_DC_64_BIT)  # fmt: skip
    put(0x0010, "HH", slave.address, 0)  # station address, alias
    put(0x0110, "H", _link_status(last=last))
    put(0x0120, "H", state)  # AL control: state requested by the master
    put(0x0130, "H", state)  # AL status
    put(0x0134, "H", 0)  # AL status code
    # 0x0300 to 0x0313: receive errors, forwarded errors and lost links of the ports, all 0
    put(0x0400, "H", _WATCHDOG_DIVIDER)
    put(0x0410, "H", _WATCHDOG_PERIODS)  # of the process data interface
    put(0x0420, "H", _WATCHDOG_PERIODS)  # of the process data
    put(0x0440, "H", 1 if communicating else 0)  # process data watchdog: 1 while fed
    put(0x0910, "Q", system_time_ns)
    put(0x0928, "I", 700 * slave.id)  # delay from the reference clock, ns
    return bytes(image)


def _link_status(*, last: bool) -> int:
    """Return the DL status: ports 0 and 1; only port 0 of the last slave."""
    operational, watchdog = 1 << 0, 1 << 1
    links = 1 << 4 if last else 1 << 4 | 1 << 5
    communication = 1 << 9 if last else 1 << 9 | 1 << 11
    closed = (1 << 10 if last else 0) | 1 << 12 | 1 << 14
    return operational | watchdog | links | communication | closed
