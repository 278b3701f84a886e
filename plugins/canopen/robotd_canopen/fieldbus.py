"""Diagnostics of the network."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import BusNode, BusState, BusStatus, ConnectionState, FieldbusDriver
from robotd_canopen.diagnostic_values import diagnostic_values
from robotd_canopen.master import Master
from robotd_canopen.nmt import NmtState
from robotd_canopen.node import Node
from robotd_canopen.pdo import Direction


class CanopenFieldbus(FieldbusDriver):
    """One bus, number 0."""

    def __init__(self, master: Master) -> None:
        self._master = master

    @property
    def buses(self) -> int:
        return 1

    def status(self, bus: int) -> BusStatus:
        network = self._master
        nodes = [network.nodes[number] for number in sorted(network.nodes)]
        counters = network.bus.counters
        return BusStatus(
            state=_STATES[network.state],
            period_s=network.layout.sync_period_s,
            axes=len(network.axes),
            input_size=len(network.io.inputs),
            output_size=len(network.io.outputs),
            lost_frames=counters.malformed + counters.error_frames,
            timeouts=sum(node.lost_heartbeats for node in nodes),
            nodes=tuple(self._node(position, node) for position, node in enumerate(nodes)),
            note=self._note(),
            details=diagnostic_values(network),
            extra={
                "rx_pdo_size": self._size(Direction.RECEIVE),
                "tx_pdo_size": self._size(Direction.TRANSMIT),
            },
        )

    def node_ids(self, bus: int) -> Sequence[int]:
        return sorted(self._master.nodes)

    def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
        return self._master.nodes[node].sdo.upload(index, subindex)

    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        written = self._master.nodes[node]
        try:
            written.sdo.download(index, subindex, data)
        finally:  # a write without a response may have been executed
            for axis in self._master.axes:
                if axis.node is written:
                    axis.objects.forget()

    def reset_statistics(self, bus: int) -> None:
        counters = self._master.bus.counters
        counters.malformed = counters.error_frames = 0
        counters.receive_errors = counters.send_errors = 0
        self._master.sync.jitter_ns = 0
        for node in self._master.nodes.values():
            node.lost_heartbeats = 0

    def _node(self, position: int, node: Node) -> BusNode:
        vendor, product, revision, serial = node.identity or (0, 0, 0, 0)
        alive = node.online or not node.fault
        state = node.state if alive else NmtState.UNKNOWN
        return BusNode(
            id=node.id,
            state=_NODE_STATES[state],
            position=position,
            address=node.id,
            offline=not node.online,
            vendor_id=vendor,
            product_code=product,
            revision=revision,
            serial=serial,
            axes=sum(axis.node is node for axis in self._master.axes),
            fault=self._fault(node),
        )

    def _fault(self, node: Node) -> str:
        active = self._master.emergencies.active.get(node.id)
        emergency = active.text if active is not None else ""
        return node.fault or emergency or self._master.supervision.doubled.get(node.id, "")

    def _size(self, direction: Direction) -> int:
        return sum(
            pdo.layout.size for pdo in self._master.layout.pdos() if pdo.direction is direction
        )

    def _note(self) -> str:
        network = self._master
        parts = [f"CANopen on {network.bus.name}, states are NMT states"]
        parts += [str(emergency) for emergency in list(network.emergencies.active.values())]
        parts += [network.supervision.fault()] if network.supervision.lost else []
        return "; ".join(parts)


_STATES = {
    ConnectionState.IDLE: BusState.INITIALISING,
    ConnectionState.RUNNING: BusState.CONFIGURABLE,
    ConnectionState.COMMUNICATING: BusState.OPERATIONAL,
    ConnectionState.UNKNOWN: BusState.OPERATIONAL,
    ConnectionState.SHUTDOWN: BusState.INITIALISING,
}

_NODE_STATES = {
    NmtState.BOOT_UP: BusState.INITIALISING,
    NmtState.STOPPED: BusState.INPUTS_ONLY,
    NmtState.OPERATIONAL: BusState.OPERATIONAL,
    NmtState.PRE_OPERATIONAL: BusState.CONFIGURABLE,
    NmtState.UNKNOWN: BusState.UNKNOWN,
}
