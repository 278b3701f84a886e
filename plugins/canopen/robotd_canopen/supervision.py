"""The watch over nodes and bus: who is lost and why, and who is taken back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robotd.api import get_logger
from robotd_canopen.axis import Axis
from robotd_canopen.bus import Bus
from robotd_canopen.feedback import Feedback
from robotd_canopen.node import Node
from robotd_canopen.sync import NANOSECONDS

log = get_logger("canopen")

_KEPT = 100  # latest losses
_NAMED = 3  # lost nodes that a text names; more at once have one cause


class Supervision:
    """Stops all axes when a node or the bus is lost. Cycle thread, where nothing else is said.

    Attributes:
        lost: nodes that were online and are not any more, by id.
        faults: the latest losses, newest last, as text that names node and cause.
    """

    def __init__(
        self,
        bus: Bus,
        nodes: Mapping[int, Node],
        axes: Sequence[Axis],
        feedback: Feedback,
        heartbeat_timeout_s: float,
        sync_period_s: float,
    ) -> None:
        self.lost: dict[int, Node] = {}
        self.faults: list[str] = []
        self._bus, self._nodes, self._axes, self._feedback = bus, nodes, axes, feedback
        self._limit_ns = round(heartbeat_timeout_s * NANOSECONDS)
        self._sync_period_s = sync_period_s

    def begin(self) -> None:
        """Worker: communication has been started (again); nothing is lost."""
        self.lost.clear()

    def fault(self) -> str:
        """Why values are missing: the bus, or the lost nodes with their causes; "" if neither.

        Any thread.
        """
        if self._bus.fault is not None:
            return self._bus.fault
        lost = [f"{node.name}: {node.fault}" for node in list(self.lost.values())]
        more = [f"and {len(lost) - _NAMED} more nodes"] if len(lost) > _NAMED else []
        return "; ".join(lost[:_NAMED] + more)

    def watch(self, period_ns: int) -> None:
        """One period, ``period_ns`` after the one before, however long the computer paused."""
        if self._bus.fault is not None:
            for node in self._nodes.values():
                self.lose(node, self._bus.fault)
            return
        for node in self._nodes.values():
            cause = node.missing(period_ns, self._limit_ns)
            if cause:
                self.lose(node, cause)
            elif node.id in self.lost and node.configured:
                self._take_back(node)
        for number, pdo, missed in self._feedback.stale():
            age_ms = missed * self._sync_period_s * 1000
            self.lose(self._axes[number].node, f"{pdo.name} has not come for {age_ms:.0f} ms")

    def lose(self, node: Node, cause: str) -> None:
        """``node`` is given up and all axes stop. A node that is not online: no effect."""
        if node.online:
            node.online = False
            node.fault = cause + node.emergency_text()
            self.lost[node.id] = node
            self.fail(f"{node.name}: {node.fault}")

    def fail(self, reason: str) -> None:
        """Stop all axes, each with its own ramp."""
        self.faults.append(reason)
        del self.faults[:-_KEPT]
        log.error("motion is stopped", reason=reason)
        for axis in self._axes:
            axis.brake(axis.layout.options.stop_deceleration_rad_s2)

    def _take_back(self, node: Node) -> None:
        """A node that was silent and has kept its configuration; its axes stay where they are."""
        axes = [axis for axis in self._axes if axis.node is node]
        if any(self._feedback.overdue(axis.number) for axis in axes):
            return
        for axis in axes:
            axis.resume()
        node.online, node.fault = True, ""
        self.lost.pop(node.id, None)  # unless a worker has begun anew meanwhile
        log.info("a node is back", node=node.name)
