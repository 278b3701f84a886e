"""Service responses that wait for their client without delaying anything else.

Works around: rmw_fastrtps keeps ``rcl_send_response`` for up to 100 ms when it does not know the
reader of the response: the client is not discovered whole yet, or has gone before its request was
taken. So the reader of a client's first request is looked up in the ROS graph, and a response
without one waits here. Where the graph is behind, the call itself waits, with the interpreter
released (``release_gil.py``). rclpy shows the header of a request, which a deferred response needs,
in one place only: in the call of ``Service.send_response``.
Measured: the look-up takes 27 us, once for each client of the service (x86_64).
Upstream: https://github.com/ros2/rmw_fastrtps/pull/390 introduced the wait,
https://github.com/ros2/ros2/issues/1253 asks for another solution (closed).
Ends with: no version yet; since rclpy 5.0.1 the time-out is not an error.
Shown by: tests/ros/test_service_responses.py.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import rclpy
from rclpy.node import Node
from rclpy.service import Service

from robotd.log import get_logger
from robotd_ros.middleware.rcl_error import NODE_GONE
from robotd_ros.middleware.release_gil import (
    InternalsError,
    RequestId,
    ResponseSender,
    request_id_of,
)

log = get_logger("ros")

_READER_TIMEOUT_S = 10.0  # discovery on a busy computer; rmw_fastrtps: 0.1, and holds up others
_MAX_WAITING = 512  # responses; beyond that the oldest is dropped
_CHECK_PERIOD_S = 0.01
_GRAPH_VALIDITY_S = 0.002  # one look-up serves a burst
PREFIX_BYTES = 12  # of a GUID: the participant; RTPS 2.5, table 9.1
_READER = 0x04  # bit of the last byte of a GUID: RTPS 2.5, table 9.1
_MAX_KNOWN = 64  # readers remembered without a look-up


class ServiceResponses:
    """Sends the responses of one service."""

    def __init__(self, node: Node, service: Service) -> None:
        self._node = node
        self._service = service
        self._name = service.service_name
        self._rclpy_send = service.send_response
        self._send_unlocked: ResponseSender | None = None
        try:
            self._send_unlocked = ResponseSender(service)
        except InternalsError as error:
            log.warning("responses are sent by plain rclpy", service=self._name, reason=str(error))
        self._checks_readers = "fastrtps" in rclpy.get_rmw_implementation_identifier()
        self._known: set[bytes] = set()
        self._seen: set[bytes] | None = set()
        self._seen_s = -_GRAPH_VALIDITY_S
        self._lock = threading.Lock()
        self._waiting: list[_Waiting] = []

    def defer(self, on_request: Callable[[Any, Any], None]) -> None:
        """Call ``on_request(request, header)`` instead of sending a response at once.

        The service's own callback must return the request: every rclpy executor passes what it
        returned, with the request's header, to ``send_response``.
        """
        self._service.send_response = on_request

    def send(self, response: Any, header: Any) -> None:
        """Send now, or from a thread as soon as the client's reader is discovered.

        A client whose reader does not come within ten seconds has gone, its response is dropped.
        For a node that is gone there is a warning. Any thread.

        Args:
            response: of the service's type.
            header: of the request, from rclpy.
        """
        request = request_id_of(header)
        reader = reader_of(request) if request and self._checks_readers else None
        waiting = _Waiting(
            response, header, request, reader or b"", time.monotonic() + _READER_TIMEOUT_S
        )
        if reader is None or reader in self._known or waiting.can_be_sent(self._readers()):
            self._send(waiting)
            return
        with self._lock:
            is_first = not self._waiting
            self._waiting = [*self._waiting[1 - _MAX_WAITING :], waiting]
        if is_first:
            threading.Thread(target=self._deliver, name="robotd-responses").start()

    def _deliver(self) -> None:
        """Send what waits when its reader has come; ends when nothing waits any more."""
        left = 1
        while left:
            time.sleep(_CHECK_PERIOD_S)
            readers = self._readers() or set()
            ready = []
            with self._lock:
                waiting, self._waiting = self._waiting, []
                for response in waiting:
                    if response.can_be_sent(readers):
                        ready.append(response)
                    elif time.monotonic() < response.until_s:
                        self._waiting.append(response)
                left = len(self._waiting)
            for response in ready:
                try:
                    self._send(response)
                except Exception:  # of one response, such as a text that is not UTF-8
                    log.exception("response not sent", service=self._name)

    def _send(self, waiting: _Waiting) -> None:
        try:
            if waiting.request is None or self._send_unlocked is None:
                self._rclpy_send(waiting.response, waiting.header)
                failure = ""
            else:
                failure = self._send_unlocked(waiting.response, waiting.request)
        except NODE_GONE as error:
            failure = str(error)
        if not failure:
            self._remember(waiting.reader)
            return
        self._known.discard(waiting.reader)
        log.warning("response not sent", service=self._name, reason=failure)

    def _remember(self, reader: bytes) -> None:
        """Skip the look-up for this reader from now on."""
        if reader not in self._known:
            if len(self._known) >= _MAX_KNOWN:
                self._known.clear()
            self._known.add(reader)

    def _readers(self) -> set[bytes] | None:
        """GUIDs of all readers of the service's responses; None when the node is destroyed."""
        now_s = time.monotonic()
        if now_s - self._seen_s >= _GRAPH_VALIDITY_S:
            self._seen, self._seen_s = self._read_graph(), now_s
        return self._seen

    def _read_graph(self) -> set[bytes] | None:
        topic = f"rr{self._name}Reply"
        try:
            found = self._node.get_subscriptions_info_by_topic(topic, no_mangle=True)
        except NODE_GONE:
            return None
        return {bytes(endpoint.endpoint_gid) for endpoint in found}


class _Waiting(NamedTuple):
    """A response; ``until_s`` is monotonic time."""

    response: Any
    header: Any
    request: RequestId | None
    reader: bytes
    until_s: float

    def can_be_sent(self, readers: set[bytes] | None) -> bool:
        """True where sending does not wait; with a destroyed node it fails at once."""
        return readers is None or self.reader in readers


def reader_of(request: RequestId) -> bytes | None:
    """Return the GUID of the response's reader, 16 bytes; None if unknown."""
    guid = bytes(request.guid)
    return guid if guid[-1] & _READER else None
