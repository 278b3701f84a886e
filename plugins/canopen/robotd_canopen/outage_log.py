"""Log of nodes that are lost, and one line for those that return without configuration."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum

from robotd.api import get_logger
from robotd_canopen.node import Node

log = get_logger("canopen")

_SETTLE_NS = 500_000_000  # without a further return: then those that came back are reported
_MAX_NAMED = 3  # nodes whose causes a text lists; more at once have a common cause


class Return(Enum):
    """Kind of return of a lost node; the value is the log line."""

    RESUMED = "nodes are back with their configuration"
    RESET = "nodes answer again and need configuration; start communication again"


def causes(nodes: Iterable[Node]) -> str:
    """Format nodes with the cause of each, the first three in full."""
    texts = [f"{node.name}: {node.fault}" for node in nodes]
    more = [f"and {len(texts) - _MAX_NAMED} more nodes"] if len(texts) > _MAX_NAMED else []
    return "; ".join(texts[:_MAX_NAMED] + more)


class OutageLog:
    """Reports nodes that are lost and that come back, many in one line. Control loop."""

    def __init__(self) -> None:
        self._returned: dict[Return, dict[int, Node]] = {how: {} for how in Return}
        self._quiet_ns = 0

    def lost(self, nodes: list[Node]) -> None:
        """Note nodes lost in one period, with their causes; the core reports a lost device."""
        for returned in self._returned.values():
            for node in nodes:
                returned.pop(node.id, None)
        log.debug("nodes lost, all axes stop", reason=causes(nodes))

    def came_back(self, node: Node, how: Return) -> None:
        """Note the return of a node; reported with those that follow soon."""
        self._returned[how][node.id] = node
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
            if nodes:
                write = log.debug if how is Return.RESUMED else log.warning
                write(how.value, nodes=", ".join(node.name for node in nodes.values()))
                nodes.clear()

    def clear(self) -> None:
        """Discard what has not been reported. Worker, while no cycle watches."""
        for nodes in self._returned.values():
            nodes.clear()
