"""Diagnostics of the network, in the words of an EtherCAT reader."""

from __future__ import annotations

from robotd.api import ConnectionState, FieldbusDriver, NetworkState, SlaveInfo
from robotd_canopen.details import details
from robotd_canopen.master import Master
from robotd_canopen.nmt import AL_STATES, NmtState
from robotd_canopen.node import Node
from robotd_canopen.pdo import Direction

_OPERATIONAL, _INIT, _PREOP = 16, 1, 2


class CanopenFieldbus(FieldbusDriver):
    """One master, id 0."""

    def __init__(self, master: Master) -> None:
        self._master = master

    @property
    def masters(self) -> int:
        return 1

    def network_state(self, master: int) -> NetworkState:
        network = self._master
        nodes = [network.nodes[number] for number in sorted(network.nodes)]
        slaves = tuple(self._slave(position, node) for position, node in enumerate(nodes))
        counters = network.bus.counters
        return NetworkState(
            state=_STATES[network.state],
            comm_period_us=round(network.layout.sync_period_s * 1e6),
            total_axes=len(network.axes),
            input_size=len(network.io.inputs),
            output_size=len(network.io.outputs),
            rx_pdo_size=self._size(Direction.RECEIVE),
            tx_pdo_size=self._size(Direction.TRANSMIT),
            packet_loss=counters.malformed + counters.error_frames,
            packet_timeout=sum(node.lost_heartbeats for node in nodes),
            slaves=slaves,
            note=self._note(),
            details=details(network),
        )

    def reset_statistics(self, master: int) -> None:
        counters = self._master.bus.counters
        counters.malformed = counters.error_frames = 0
        counters.receive_errors = counters.send_errors = 0
        self._master.sync.jitter_ns = 0
        for node in self._master.nodes.values():
            node.lost_heartbeats = 0

    def _slave(self, position: int, node: Node) -> SlaveInfo:
        vendor, product, revision, serial = node.identity or (0, 0, 0, 0)
        alive = node.online or not node.fault
        state = node.state if alive else NmtState.UNKNOWN
        return SlaveInfo(
            id=node.id,
            state=AL_STATES[state],
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
        return node.fault or (active.text if active is not None else "")

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
    ConnectionState.IDLE: _INIT,
    ConnectionState.RUNNING: _PREOP,
    ConnectionState.COMMUNICATING: _OPERATIONAL,
    ConnectionState.UNKNOWN: _OPERATIONAL,
    ConnectionState.SHUTDOWN: _INIT,
}
