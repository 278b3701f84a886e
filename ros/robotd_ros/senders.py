"""Names of the clients that send requests and commands, for the event log."""

from __future__ import annotations

import threading
import time
from typing import Any

from rclpy.node import Node

from robotd_ros.middleware import NODE_GONE, PREFIX_BYTES, request_id_of

MAX_KNOWN = 256
TOPIC_VALIDITY_S = 1.0  # of the publishers of a topic
EVERY_NODE_PUBLISHES = "/parameter_events"
UNKNOWN = "_NODE_NAME_UNKNOWN_"  # in the graph: its node is not known, as of one that has gone


class Senders:
    """Finds the names of clients. Worker threads and the executor; a look-up takes 0.3 ms.

    A request carries the GUID of its writer, whose first 12 bytes identify the process's
    participant; every node publishes ``/parameter_events``, whose publishers reveal the nodes of
    each participant.

    Args:
        node: with which the ROS graph is read.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._known: dict[bytes, str] = {}
        self._topics: dict[str, tuple[float, str]] = {}
        self._lock = threading.Lock()

    def of_request(self, header: Any) -> str:
        """Return the nodes of the process that sent a request; "" if unknown.

        Of a process without nodes in the graph, its number in the graph: it has gone already, or
        was not discovered yet.

        Args:
            header: of the request, from rclpy.
        """
        request = request_id_of(header)
        if request is None:
            return ""
        prefix = bytes(request.guid)[:PREFIX_BYTES]
        with self._lock:
            if prefix not in self._known:
                name = self._names(EVERY_NODE_PUBLISHES, prefix)
                if not name:
                    return f"unnamed client {prefix.hex()}"
                if len(self._known) >= MAX_KNOWN:
                    self._known.clear()
                self._known[prefix] = name
            return self._known[prefix]

    def of_topic(self, topic: str) -> str:
        """Return the nodes that publish ``topic``: the sender where there is one."""
        now_s = time.monotonic()
        with self._lock:
            found_s, names = self._topics.get(topic, (-TOPIC_VALIDITY_S, ""))
            if now_s - found_s >= TOPIC_VALIDITY_S:
                names = self._names(topic, b"")
                self._topics[topic] = now_s, names
            return names

    def _names(self, topic: str, prefix: bytes) -> str:
        try:
            found = self._node.get_publishers_info_by_topic(topic)
        except NODE_GONE:
            return ""
        names = {
            f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
            for endpoint in found
            if endpoint.node_name != UNKNOWN and bytes(endpoint.endpoint_gid).startswith(prefix)
        }
        return ", ".join(sorted(names))
