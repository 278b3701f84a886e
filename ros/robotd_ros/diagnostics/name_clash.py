"""Detection of other processes that serve nodes of the same names.

ROS allows it without a word: two robots of one name both receive every command and answer every
service. Namespaces keep them apart.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rclpy.node import Node

from robotd.log import get_logger
from robotd_ros.diagnostics.part_status import Level, Status
from robotd_ros.middleware import Participant

log = get_logger("ros")

PART = "names"
ADVICE = "give each robot a namespace: --ros-args -r __ns:=/NAME"
_TOPIC = "/parameter_events"  # every node publishes it


class NameClash:
    """Compares the names of this process's nodes with the ROS graph. One thread.

    Args:
        nodes: all of this process, at least one; their node graph is asked.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._node = nodes[0]
        self._names = {node.get_fully_qualified_name() for node in nodes}
        self._known: frozenset[str] = frozenset()
        self._is_logged = False

    def check(self) -> Status | None:
        """Warning while another process has nodes of these names.

        Beginning and end are logged once each, when two checks agree: names come and go one by one
        while processes are discovered.

        Raises InvalidHandle when the node is gone.
        """
        found = self._node.get_node_names_and_namespaces()
        counts = Counter(_full_name(name, namespace) for name, namespace in found)
        doubled = frozenset(name for name in self._names if counts[name] > 1)
        is_settled, self._known = doubled == self._known, doubled
        begins_or_ends = is_settled and bool(doubled) is not self._is_logged
        if begins_or_ends:
            self._is_logged = bool(doubled)
        if not doubled:
            if begins_or_ends:
                log.info("no other process serves nodes of the same names any more")
            return None
        others = " and ".join(self._others(doubled)) or "not known"
        if begins_or_ends:
            names = sorted(doubled)
            log.warning(
                "another process serves nodes of the same names: both obey every command",
                nodes=names,
                other=others,
                advice=ADVICE,
            )
        text = f"another process serves {len(doubled)} nodes of the same names; {ADVICE}"
        return Status(PART, Level.WARN, text, {"other": others, "nodes": " ".join(sorted(doubled))})

    def _others(self, doubled: frozenset[str]) -> list[str]:
        """Descriptions of the other processes, as far as the middleware shows them."""
        participants = {
            participant
            for endpoint in self._node.get_publishers_info_by_topic(_TOPIC)
            if _full_name(endpoint.node_name, endpoint.node_namespace) in doubled
            and (participant := Participant.of(bytes(endpoint.endpoint_gid)))
        }
        own = [participant for participant in participants if participant.is_own]
        own_host = own[0].host if len(own) == 1 else None
        others = participants.difference(own) if own_host is not None else participants
        return sorted(participant.describe(own_host) for participant in others)


def _full_name(name: str, namespace: str) -> str:
    return f"{namespace.rstrip('/')}/{name}"
