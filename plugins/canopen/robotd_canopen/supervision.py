"""Supervision of nodes and bus: loss with its cause, and return."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robotd.api import NANOSECONDS, get_logger
from robotd_canopen.bus import Bus
from robotd_canopen.canopen_axis import CanopenAxis
from robotd_canopen.feedback import Feedback
from robotd_canopen.node import MISSED, RESET, Node
from robotd_canopen.outage_log import OutageLog, Return, causes

log = get_logger("canopen")

_KEPT = 100  # latest losses


class Supervision:
    """Stops all axes when a node or the bus is lost. Control loop, unless noted.

    Attributes:
        lost: lost nodes by id.
        faults: the latest losses, newest last, as text that names node and cause.
        doubled: signs of a duplicate node id, by id. They stop nothing: nodes may repeat frames.
    """

    def __init__(
        self,
        bus: Bus,
        nodes: Mapping[int, Node],
        axes: Sequence[CanopenAxis],
        feedback: Feedback,
        heartbeat_timeout_s: float,
        sync_period_s: float,
    ) -> None:
        self.lost: dict[int, Node] = {}
        self.faults: list[str] = []
        self._reset: set[int] = set()  # lost nodes that answer again, without configuration
        self.doubled: dict[int, str] = {}
        self._outage = OutageLog()
        self._bus, self._nodes, self._axes, self._feedback = bus, nodes, axes, feedback
        self._limit_ns = round(heartbeat_timeout_s * NANOSECONDS)
        self._sync_period_s = sync_period_s

    @property
    def silent(self) -> list[Node]:
        """Lost nodes that have not answered since. Any thread."""
        return [node for node in list(self.lost.values()) if node.id not in self._reset]

    def begin(self) -> None:
        """Worker: start with no node lost; communication has been started."""
        self.lost.clear()
        self.doubled.clear()
        self._reset.clear()
        self._outage.clear()

    def fault(self) -> str:
        """Return the bus fault, or the lost nodes with their causes; "" without one.

        Any thread.
        """
        if self._bus.fault is not None:
            return self._bus.fault
        return causes(list(self.lost.values()))

    def watch(self, period_ns: int, now_ns: int) -> None:
        """Supervise one control period, ``period_ns`` after the previous one."""
        for node in self._nodes.values():
            self._note_duplicate(node, now_ns)
        lost = self._lose_silent(period_ns)
        if lost:
            self._outage.lost(lost)
        self._outage.advance(period_ns, complete=not self.silent)

    def stop(self, reason: str) -> None:
        """Stop all axes, each with its own ramp, and remember why."""
        self.faults.append(reason)
        del self.faults[:-_KEPT]
        for axis in self._axes:
            axis.brake(axis.options.stop_deceleration_rad_s2)

    def fail(self, reason: str) -> None:
        """Stop all axes for something that is not the loss of a node."""
        log.error("motion stopped", reason=reason)
        self.stop(reason)

    def _lose_silent(self, period_ns: int) -> list[Node]:
        """Update which nodes are lost; return those that are lost since this period."""
        nodes, bus_fault = self._nodes.values(), self._bus.fault
        if bus_fault is not None:
            return [node for node in nodes if self._lose(node, bus_fault)]
        lost = []
        for node in nodes:
            cause = node.missing(period_ns, self._limit_ns)
            if cause and self._lose(node, cause):
                lost.append(node)
            elif cause == RESET and node.id in self.lost and node.id not in self._reset:
                self._wait_for_configuration(node, RESET)
            elif not cause and node.id in self.lost and node.configured and not node.online:
                self._take_back(node)  # unless a worker has started it just now
        for number, pdo, missed in self._feedback.stale():
            age_ms, node = missed * self._sync_period_s * 1000, self._axes[number].node
            if self._lose(node, f"{pdo.name} has not come for {age_ms:.0f} ms"):
                lost.append(node)
        return lost

    def _note_duplicate(self, node: Node, now_ns: int) -> None:
        sign = node.duplicate(now_ns)
        if sign and node.id not in self.doubled:
            log.warning("suspected duplicate node id", node=node.name, reason=sign)
            self.doubled[node.id] = sign

    def _lose(self, node: Node, cause: str) -> bool:
        """Mark ``node`` as lost and stop all axes; False if it is not online."""
        if not node.online:
            return False
        node.online = False
        node.fault = cause + node.emergency_text()
        self.lost[node.id] = node
        self._reset.discard(node.id)
        if cause == RESET:
            self._reset.add(node.id)
            self._forget(node)
        self.stop(f"{node.name}: {node.fault}")
        return True

    def _wait_for_configuration(self, node: Node, cause: str) -> None:
        """Mark a lost node that answers again: a worker must configure it."""
        self._reset.add(node.id)
        node.fault, node.configured = cause, False
        self._forget(node)
        self._outage.came_back(node, Return.RESET)

    def _forget(self, node: Node) -> None:
        """Discard the values of a node that needs configuration; it may map other objects."""
        for axis in self._axes:
            if axis.node is node:
                self._feedback.forget(axis.number)

    def _take_back(self, node: Node) -> None:
        """Take back a node that has kept its configuration; its axes stay at rest.

        Event-driven TPDOs, as those of I/O modules are, may have been missed: a worker reads
        their values when it configures the node again.
        """
        axes = [axis for axis in self._axes if axis.node is node]
        if any(self._feedback.overdue(axis.number) for axis in axes):
            return
        if not axes or any(self._feedback.event_driven(axis.number) for axis in axes):
            self._wait_for_configuration(node, MISSED)
            return
        for axis in axes:
            axis.resume()
        node.online, node.fault = True, ""
        self.lost.pop(node.id, None)  # unless a worker has restarted communication meanwhile
        self._outage.came_back(node, Return.RESUMED)
