"""Diagnostics of the bus, with the error counters of the ports of each slave."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass

from robotd.api import BusNode, BusState, BusStatus, NotReady, RobotdError
from robotd_cia402.device import BUS_STATES, Cia402Fieldbus
from robotd_ethercat.al_status import AlState, al_code_text
from robotd_ethercat.exchange import Counters
from robotd_ethercat.master import Master
from robotd_ethercat.slave import Slave

_REGISTER_BYTES = 0x1000  # of a slave controller, without its process memory
_CLEAR = bytes(1)
_FIRST_COUNTER = 0x0300
_COUNTERS = struct.Struct(
    "<8B4B2B2x4B"
)  # per port: invalid frame, RX error; forwarded; PU, PDI; lost
_REGISTERS = (0x0300, 0x0308, 0x030C, 0x030D, 0x0310)
"""Addresses; a write there clears a group of counters."""


@dataclass(frozen=True)
class PortCounters:
    """Errors at ports 0 to 3 since the counters were cleared; each stops at 255.

    ETG.1000.4, registers 0x0300 to 0x0313.

    Attributes:
        invalid: frames with a wrong checksum or length, first seen at this port.
        receive: errors of the physical layer.
        forwarded: frames that another slave before this one had marked as invalid.
        lost: losses of the link.
    """

    invalid: tuple[int, ...]
    receive: tuple[int, ...]
    forwarded: tuple[int, ...]
    lost: tuple[int, ...]

    @classmethod
    def read(cls, slave: Slave) -> PortCounters:
        """Read the registers. Raises DeviceTimeout."""
        values = _COUNTERS.unpack(slave.read_register(_FIRST_COUNTER, _COUNTERS.size))
        return cls(values[0:8:2], values[1:8:2], values[8:12], values[14:18])

    @property
    def text(self) -> str:
        """``port 1: lost links 2, invalid frames 3``; "" while all are 0."""
        ports = []
        for port in range(4):
            named = {
                "lost links": self.lost[port],
                "invalid frames": self.invalid[port],
                "receive errors": self.receive[port],
                "forwarded errors": self.forwarded[port],
            }
            counted = [f"{name} {count}" for name, count in named.items() if count]
            if counted:
                ports.append(f"port {port}: {', '.join(counted)}")
        return "; ".join(ports)

    @property
    def extra(self) -> dict[str, int]:
        """Entries of ``BusNode.extra``, sums over the ports."""
        return {
            "lost_links": sum(self.lost),
            "invalid_frames": sum(self.invalid),
            "receive_errors": sum(self.receive),
            "forwarded_errors": sum(self.forwarded),
        }


class EthercatFieldbus(Cia402Fieldbus[Master]):
    """One bus, number 0; nodes are named by their place on the cable, from 0."""

    @property
    def nodes(self) -> Mapping[int, Slave]:
        return self._master.slaves

    @property
    def register_bytes(self) -> int:
        return _REGISTER_BYTES

    def status(self, bus: int) -> BusStatus:
        master = self._master
        counters = master.exchange.counters
        ports = {slave.number: _ports(slave) for slave in master.slaves.values()}
        nodes = tuple(self._status(slave, ports[number]) for number, slave in master.slaves.items())
        return BusStatus(
            state=BUS_STATES[master.state],
            period_s=master.period_s,
            axes=len(master.axes),
            input_size=sum(node.input_size for node in nodes),
            output_size=sum(node.output_size for node in nodes),
            lost_frames=counters.lost + counters.incomplete,
            timeouts=counters.lost,
            nodes=nodes,
            note=self._note(),
            details=self._details(ports),
            extra={
                "rx_pdo_size": sum(node.output_size for node in nodes),
                "tx_pdo_size": sum(node.input_size for node in nodes),
                "rings": 1,
            },
        )

    def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
        return self._slave(node).read_register(address, length)

    def reset_statistics(self, bus: int) -> None:
        self._master.exchange.counters = Counters()
        self._master.jitter_ns = 0
        for slave in self._master.slaves.values():
            slave.losses = 0
            for address in _REGISTERS:
                self._clear(slave, address)

    def _upload(self, node: int, index: int, sub: int) -> bytes:
        return self._slave(node).upload(index, sub)

    def _download(self, node: int, index: int, sub: int, data: bytes) -> None:
        self._slave(node).download(index, sub, data, retry=False)

    def _clear(self, slave: Slave, address: int) -> None:
        try:
            slave.write_register(address, _CLEAR)  # a write of any value clears the counters
        except RobotdError:
            return

    def _slave(self, node: int) -> Slave:
        slave = self._master.slaves[node]
        if node >= len(self._master.bus.slaves):
            raise NotReady(f"{slave.name}: it has not been found on the bus")
        return slave

    def _status(self, slave: Slave, ports: PortCounters | None) -> BusNode:
        outputs, inputs = slave.sizes
        return self._node(
            slave,
            _NODE_STATES[slave.state],
            al_code_text(slave.al_code),
            error_code=slave.al_code,
            position=slave.number,
            address=slave.alias,
            input_size=inputs,
            output_size=outputs,
            extra={
                "alias": slave.alias,
                "inaccessible": int(slave.state is AlState.NONE),
                **(ports.extra if ports is not None else {}),
            },
        )

    def _note(self) -> str:
        fault = self._master.fault()
        base = f"EtherCAT on {self._master.bus_name}"
        return f"{base}; {fault}" if fault else base

    def _details(self, ports: Mapping[int, PortCounters | None]) -> Mapping[str, str]:
        """Values for ``/diagnostics``, by name."""
        master = self._master
        exchange, counters, clock = master.exchange, master.exchange.counters, master.observer
        values = {
            "frames sent": str(counters.sent),
            "frames received": str(counters.received),
            "lost frames": str(counters.lost),
            "incomplete frames": str(counters.incomplete),
            "working counter": f"{exchange.working_counter} of {exchange.needed}",
            "largest deviation of the period (ms)": f"{master.jitter_ns / 1e6:.2f}",
            "slaves in Op": str(sum(slave.online for slave in master.slaves.values())),
            "lost slaves since the start": str(sum(s.losses for s in master.slaves.values())),
        }
        for number, counted in ports.items():
            if counted is not None and counted.text:
                values[f"ports of {master.slaves[number].name}"] = counted.text
        if master.bring_up.clocks:
            values |= {
                "phase to SYNC0 (µs)": f"{clock.phase_ns / 1e3:.1f}",
                "phase, lowest and highest (µs)": (
                    f"{clock.lowest_ns / 1e3:.1f} {clock.highest_ns / 1e3:.1f}"
                ),
                "drift of the bus time (ppm)": f"{clock.drift_ppm:.2f}",
            }
        return values


def _ports(slave: Slave) -> PortCounters | None:
    """Read the counters of the ports; None while the slave does not answer."""
    if not slave.online:
        return None
    try:
        return PortCounters.read(slave)
    except RobotdError:
        return None


_NODE_STATES = {
    AlState.NONE: BusState.UNKNOWN,
    AlState.INIT: BusState.INITIALISING,
    AlState.PRE_OP: BusState.CONFIGURABLE,
    AlState.BOOT: BusState.UPDATING,
    AlState.SAFE_OP: BusState.INPUTS_ONLY,
    AlState.OP: BusState.OPERATIONAL,
}
