"""Diagnostics of the network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import islice

from robotd.api import NANOSECONDS, BusNode, BusState, BusStatus
from robotd_canopen.feedback import SECOND_SYNC
from robotd_canopen.master import Master
from robotd_canopen.node import NmtState, Node
from robotd_canopen.pdo import Direction
from robotd_cia402.device import BUS_STATES, Cia402Fieldbus

_MAX_SHOWN_EMERGENCIES = 5  # latest emergencies


class CanopenFieldbus(Cia402Fieldbus[Master]):
    """One bus, number 0; nodes are named by their ids."""

    @property
    def nodes(self) -> Mapping[int, Node]:
        return dict(sorted(self._master.nodes.items()))

    def status(self, bus: int) -> BusStatus:
        network, nodes = self._master, list(self.nodes.values())
        counters = network.bus.counters
        return BusStatus(
            state=BUS_STATES[network.state],
            period_s=network.period_s,
            axes=len(network.axes),
            input_size=len(network.io.inputs),
            output_size=len(network.io.outputs),
            lost_frames=counters.malformed + counters.error_frames,
            timeouts=sum(node.lost_heartbeats for node in nodes),
            nodes=tuple(self._status(position, node) for position, node in enumerate(nodes)),
            note=self._note(),
            details=self._details(),
            extra={
                "rx_pdo_size": self._size(Direction.RECEIVE),
                "tx_pdo_size": self._size(Direction.TRANSMIT),
            },
        )

    def reset_statistics(self, bus: int) -> None:
        counters = self._master.bus.counters
        counters.malformed = counters.error_frames = 0
        counters.receive_errors = counters.send_errors = counters.dropped = 0
        self._master.sync.jitter_ns = 0
        for node in self._master.nodes.values():
            node.lost_heartbeats = 0

    def _upload(self, node: int, index: int, sub: int) -> bytes:
        return self._master.nodes[node].sdo.upload(index, sub)

    def _download(self, node: int, index: int, sub: int, data: bytes) -> None:
        self._master.nodes[node].sdo.download(index, sub, data)

    def _status(self, position: int, node: Node) -> BusNode:
        alive = node.online or not node.fault
        state = _NODE_STATES[node.state if alive else NmtState.UNKNOWN]
        doubled = self._master.supervision.doubled.get(node.number, "")
        return self._node(node, state, doubled, position=position, address=node.number)

    def _size(self, direction: Direction) -> int:
        return sum(
            pdo.layout.size for pdo in self._master.layout.pdos() if pdo.direction is direction
        )

    def _note(self) -> str:
        network = self._master
        parts = [f"CANopen on {network.bus_name}, states are NMT states", *self._in_force()]
        parts += [SECOND_SYNC] if network.feedback.second_sync else []
        parts += [network.supervision.fault()] if network.supervision.lost else []
        return "; ".join(parts)

    def _in_force(self) -> list[str]:
        active = [node.emergency for node in self._master.nodes.values()]
        return [str(emergency) for emergency in active if emergency is not None]

    def _details(self) -> Mapping[str, str]:
        """Loads, counters, SYNC, and the latest emergencies with their age, by name."""
        network = self._master
        bus, counters, now_ns = network.bus, network.bus.counters, network.clock.now_ns()
        silent = [
            f"{n.label}: {n.lost_heartbeats}" for n in self.nodes.values() if n.lost_heartbeats
        ]
        latest = islice(reversed(list(network.emergencies)), _MAX_SHOWN_EMERGENCIES)
        history = [f"{e}, {(now_ns - e.time_ns) / NANOSECONDS:.1f} s ago" for e in latest]
        return {
            "bus load (%)": f"{100 * bus.load:.0f}",
            "computed bus load (%)": f"{100 * network.layout.bus_load:.0f}",
            "frames received": str(counters.received),
            "frames sent": str(counters.sent),
            "malformed frames": _counted(counters.malformed, bus.last_malformed),
            "error frames": _counted(counters.error_frames, bus.last_error),
            "failed receives": str(counters.receive_errors),
            "failed sends": str(counters.send_errors),
            "frames dropped, queue full": str(counters.dropped),
            "lost heartbeats": ", ".join(silent) or "0",
            "largest SYNC deviation (ms)": f"{network.sync.jitter_ns / 1e6:.2f}",
            "EMCY in force": _joined(self._in_force()),
            "latest EMCY": _joined(history),
        }


def _counted(count: int, latest: str) -> str:
    return f"{count}, the latest: {latest}" if latest else str(count)


def _joined(texts: Iterable[str]) -> str:
    return "; ".join(texts) or "none"


_NODE_STATES = {
    NmtState.BOOT_UP: BusState.INITIALISING,
    NmtState.STOPPED: BusState.INPUTS_ONLY,
    NmtState.OPERATIONAL: BusState.OPERATIONAL,
    NmtState.PRE_OPERATIONAL: BusState.CONFIGURABLE,
    NmtState.UNKNOWN: BusState.UNKNOWN,
}
