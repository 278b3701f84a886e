"""Diagnostics of the bus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robotd.api import (
    BusNode,
    BusState,
    BusStatus,
    ConnectionState,
    DeviceTimeout,
    FieldbusDriver,
    NotReady,
)
from robotd_ethercat.al_status import AlState, al_code_text
from robotd_ethercat.exchange import Counters
from robotd_ethercat.master import Master
from robotd_ethercat.port_counters import REGISTERS, PortCounters
from robotd_ethercat.slave import Slave

_REGISTER_BYTES = 0x1000  # of a slave controller, without its process memory
_CLEAR = bytes(1)


class EthercatFieldbus(FieldbusDriver):
    """One bus, number 0; nodes are named by their place on the cable, from 0."""

    def __init__(self, master: Master) -> None:
        self._master = master

    @property
    def buses(self) -> int:
        return 1

    @property
    def register_bytes(self) -> int:
        return _REGISTER_BYTES

    def status(self, bus: int) -> BusStatus:
        master = self._master
        counters = master.exchange.counters
        ports = {slave.number: _ports(slave) for slave in master.slaves.values()}
        nodes = tuple(self._node(slave, ports[number]) for number, slave in master.slaves.items())
        return BusStatus(
            state=_STATES[master.state],
            period_s=master.plan.period_s,
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

    def node_ids(self, bus: int) -> Sequence[int]:
        return [*self._master.slaves]

    def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
        return self._slave(node).read_register(address, length)

    def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
        return self._slave(node).upload(index, subindex)

    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        slave = self._slave(node)
        try:
            slave.download(index, subindex, data, retry=False)
        finally:  # a write without an answer may have been executed
            for axis, owner in self._master.drives:
                if owner is slave:
                    axis.objects.forget()

    def reset_statistics(self, bus: int) -> None:
        self._master.exchange.counters = Counters()
        self._master.jitter_ns = 0
        for slave in self._master.slaves.values():
            slave.losses = 0
            for address in REGISTERS:
                self._clear(slave, address)

    def _clear(self, slave: Slave, address: int) -> None:
        try:
            slave.write_register(address, _CLEAR)  # a write of any value clears the counters
        except DeviceTimeout:
            return

    def _slave(self, node: int) -> Slave:
        slave = self._master.slaves[node]
        if node >= len(self._master.bus.slaves):
            raise NotReady(f"{slave.name}: it has not been found on the bus")
        return slave

    def _node(self, slave: Slave, ports: PortCounters | None) -> BusNode:
        vendor, product, revision, serial = slave.identity
        emergency = slave.emergency
        reason = slave.fault or (emergency.text if emergency is not None else "")
        outputs, inputs = slave.sizes
        return BusNode(
            id=slave.number,
            state=_NODE_STATES[slave.state],
            error_code=slave.al_code,
            position=slave.number,
            address=slave.alias,
            offline=not slave.online,
            vendor_id=vendor,
            product_code=product,
            revision=revision,
            serial=serial,
            input_size=inputs,
            output_size=outputs,
            axes=sum(owner is slave for _, owner in self._master.drives),
            fault=reason or al_code_text(slave.al_code),
            extra={
                "alias": slave.alias,
                "inaccessible": int(slave.state is AlState.NONE),
                **(ports.extra if ports is not None else {}),
            },
        )

    def _note(self) -> str:
        master = self._master
        fault = master.supervision.fault() if master.state is ConnectionState.UNKNOWN else ""
        base = f"EtherCAT on {master.plan.bus_name}"
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
    except DeviceTimeout:
        return None


_STATES = {
    ConnectionState.IDLE: BusState.INITIALISING,
    ConnectionState.RUNNING: BusState.CONFIGURABLE,
    ConnectionState.COMMUNICATING: BusState.OPERATIONAL,
    ConnectionState.UNKNOWN: BusState.OPERATIONAL,
    ConnectionState.SHUTDOWN: BusState.INITIALISING,
}

_NODE_STATES = {
    AlState.NONE: BusState.UNKNOWN,
    AlState.INIT: BusState.INITIALISING,
    AlState.PRE_OP: BusState.CONFIGURABLE,
    AlState.BOOT: BusState.UPDATING,
    AlState.SAFE_OP: BusState.INPUTS_ONLY,
    AlState.OP: BusState.OPERATIONAL,
}
