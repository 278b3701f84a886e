"""Supervision of nodes and bus: loss with its cause, and return."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import Enum

from robotd.api import NANOSECONDS, get_logger
from robotd_canopen.bus import Bus
from robotd_canopen.canopen_drive import CanopenDrive
from robotd_canopen.feedback import SECOND_SYNC, Feedback
from robotd_canopen.node import MISSED, RESET, Node
from robotd_cia402.axis import Axis

log = get_logger("canopen")

_MAX_KEPT_LOSSES = 100  # latest losses
_SETTLE_NS = 500_000_000  # without a further return: then those that came back are reported
_MAX_NAMED = 3  # nodes whose causes a text lists; more at once have a common cause


class Return(Enum):
    """Kind of return of a lost node; the value is the log line."""

    RESUMED = "nodes are back with their configuration"
    RESET = "nodes answer again and need configuration; start communication again"


class Supervision:
    """Stops all axes when a node or the bus is lost. Control loop, unless a method says otherwise.

    Attributes:
        lost: lost nodes by id.
        faults: the latest losses, newest last, as text that names node and cause.
        doubled: signs of a duplicate node id, by id. They stop nothing: nodes may repeat frames.
    """

    def __init__(
        self,
        bus: Bus,
        nodes: Mapping[int, Node],
        axes: Sequence[Axis[CanopenDrive]],
        feedback: Feedback,
        heartbeat_timeout_s: float,
        sync_period_s: float,
    ) -> None:
        self.lost: dict[int, Node] = {}
        self.faults: list[str] = []
        self._reset: set[int] = set()  # lost nodes that answer again, without configuration
        self.doubled: dict[int, str] = {}
        self._outage = OutageLog()
        self._second_sync = False  # as reported
        self._bus, self._nodes, self._axes, self._feedback = bus, nodes, axes, feedback
        self._limit_ns = round(heartbeat_timeout_s * NANOSECONDS)
        self._sync_period_s = sync_period_s

    @property
    def silent(self) -> list[Node]:
        """Lost nodes that have not answered since. Any thread."""
        return [node for node in list(self.lost.values()) if node.number not in self._reset]

    def release(self, node: Node) -> None:
        """Worker: a node that is not online is lost no more: it has started, or is given up."""
        self.lost.pop(node.number, None)
        self.doubled.pop(node.number, None)
        self._reset.discard(node.number)
        self._outage.forget(node)

    def begin(self) -> None:
        """Worker: no node is lost; communication has ended."""
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
        if self._feedback.second_sync and not self._second_sync:
            self.fail(SECOND_SYNC)
        self._second_sync = self._feedback.second_sync
        lost = self._lose_silent(period_ns)
        if lost:
            self._outage.lost(lost)
        self._outage.advance(period_ns, complete=not self.silent)

    def stop(self, reason: str) -> None:
        """Stop all axes, each with its own ramp, and remember why."""
        self.faults.append(reason)
        del self.faults[:-_MAX_KEPT_LOSSES]
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
            cause = node.loss_cause(period_ns, self._limit_ns)
            if cause and self._lose(node, cause):
                lost.append(node)
            elif cause == RESET and node.number in self.lost and node.number not in self._reset:
                self._wait_for_configuration(node, RESET)
            elif not cause and node.number in self.lost and node.configured and not node.online:
                self._take_back(node)  # unless a worker has started it just now
        for number, pdo, missed in self._feedback.stale():
            age_ms, node = missed * self._sync_period_s * 1000, self._axes[number].drive.node
            if self._lose(
                node, f"{self._feedback.name(number, pdo)} has not come for {age_ms:.0f} ms"
            ):
                lost.append(node)
        return lost

    def _note_duplicate(self, node: Node, now_ns: int) -> None:
        sign = node.duplicate(now_ns)
        if sign and node.number not in self.doubled:
            log.warning("suspected duplicate node id", node=node.name, reason=sign)
            self.doubled[node.number] = sign

    def _lose(self, node: Node, cause: str) -> bool:
        """Mark ``node`` as lost and stop all axes; False if it is not online."""
        if not node.online:
            return False
        node.online = False
        node.fault = cause + node.emergency_text()
        self.lost[node.number] = node
        self._reset.discard(node.number)
        if cause == RESET:
            self._reset.add(node.number)
            self._forget(node)
        self.stop(f"{node.name}: {node.fault}")
        return True

    def _wait_for_configuration(self, node: Node, cause: str) -> None:
        """Mark a lost node that answers again: a worker must configure it."""
        self._reset.add(node.number)
        node.fault, node.configured = cause, False
        self._forget(node)
        self._outage.came_back(node, Return.RESET)

    def _forget(self, node: Node) -> None:
        """Discard the values of a node that needs configuration; it may map other objects."""
        for axis in self._axes:
            if axis.drive.node is node:
                self._feedback.forget(axis.number)

    def _take_back(self, node: Node) -> None:
        """Take back a node that has kept its configuration; its axes stay at rest.

        Event-driven TPDOs, as those of I/O modules are, may have been missed: a worker reads
        their values when it configures the node again.
        """
        axes = [axis for axis in self._axes if axis.drive.node is node]
        if any(self._feedback.overdue(axis.number) for axis in axes):
            return
        if not axes or any(self._feedback.event_driven(axis.number) for axis in axes):
            self._wait_for_configuration(node, MISSED)
            return
        for axis in axes:
            axis.resume()
            axis.drive.forget_written()  # it may have been reset without a word
        node.online, node.fault = True, ""
        self.lost.pop(node.number, None)  # unless a worker has restarted communication meanwhile
        self._outage.came_back(node, Return.RESUMED)


class OutageLog:
    """Reports nodes that are lost and that come back, many in one line. Control loop."""

    def __init__(self) -> None:
        self._returned: dict[Return, dict[int, Node]] = {how: {} for how in Return}
        self._quiet_ns = 0

    def lost(self, nodes: list[Node]) -> None:
        """Note nodes lost in one period, with their causes; the core reports a lost device."""
        for node in nodes:
            self.forget(node)
        log.debug("nodes lost, all axes stop", reason=causes(nodes))

    def forget(self, node: Node) -> None:
        """Do not report the return of a node. Any thread."""
        for returned in self._returned.values():
            returned.pop(node.number, None)

    def came_back(self, node: Node, how: Return) -> None:
        """Note the return of a node; reported with those that follow soon."""
        self._returned[how][node.number] = node
        self._quiet_ns = 0

    def advance(self, period_ns: int, *, complete: bool) -> None:
        """Report the returns that are due, ``period_ns`` later.

        Args:
            period_ns: time since the last call.
            complete: no lost node is silent any more, so that none will follow.
        """
        self._quiet_ns += period_ns
        if not complete and self._quiet_ns < _SETTLE_NS:
            return
        for how, nodes in self._returned.items():
            if names := [node.name for node in list(nodes.values())]:
                write = log.debug if how is Return.RESUMED else log.warning
                write(how.value, nodes=", ".join(names))
                nodes.clear()

    def clear(self) -> None:
        """Discard what has not been reported. Worker, while no cycle watches."""
        for nodes in self._returned.values():
            nodes.clear()


def causes(nodes: Iterable[Node]) -> str:
    """Format nodes with the cause of each, the first three in full."""
    texts = [f"{node.name}: {node.fault}" for node in nodes]
    more = [f"and {len(texts) - _MAX_NAMED} more nodes"] if len(texts) > _MAX_NAMED else []
    return "; ".join(texts[:_MAX_NAMED] + more)
