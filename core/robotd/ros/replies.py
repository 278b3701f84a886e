"""Responses that wait for their client without holding up anything else.

rmw_fastrtps keeps ``rcl_send_response`` for up to 100 ms when it does not know the reader of the
response: the client is not discovered whole yet, or has gone before its request was taken. rclpy
holds the interpreter meanwhile, and with it the cycle. So the reader is looked up in the ROS graph
first, 10 us for each client of the service (x86_64), and a response without one waits here.
"""

from __future__ import annotations

import ctypes
import threading
import time
from typing import Any, NamedTuple

import rclpy
from rclpy._rclpy_pybind11 import RCLError, rclpy_get_subscriptions_info_by_topic
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.service import Service

from robotd.log import get_logger

log = get_logger("ros")

_WAIT_S = 0.1  # as long as rmw_fastrtps
_LOOK_S = 0.002
_READER = 0x04  # bit of the last byte of a GUID: RTPS 2.5, table 9.1


class Replies:
    """Sends the responses of one service.

    Args:
        node: the service's owner.
        service: its ``send_response``, as it is now, is what sends in the end.
    """

    def __init__(self, node: Node, service: Service) -> None:
        self._node = node
        self._name = service.service_name
        self._send_response = service.send_response
        self._looks = "fastrtps" in rclpy.get_rmw_implementation_identifier()
        self._lock = threading.Lock()
        self._waiting: list[_Waiting] = []

    def send(self, response: Any, header: Any) -> None:
        """Send now, or, in a thread of its own, as soon as the client's reader is there.

        A client whose reader does not come within 100 ms has gone, its response is dropped. For
        a node that is gone there is a warning. Any thread.

        Args:
            response: of the service's type.
            header: of the request, from rclpy.
        """
        reader = reader_of(header) if self._looks else None
        waiting = _Waiting(response, header, reader or b"", time.monotonic() + _WAIT_S)
        if reader is None or waiting.may_go(self._readers()):
            self._send(waiting)
            return
        with self._lock:
            self._waiting.append(waiting)
            is_first = len(self._waiting) == 1
        if is_first:
            threading.Thread(target=self._deliver, name="robotd-replies").start()

    def _deliver(self) -> None:
        """Send what waits when its reader has come; ends when nothing waits any more."""
        left = 1
        while left:
            time.sleep(_LOOK_S)
            readers = self._readers() or set()
            ready = []
            with self._lock:
                waiting, self._waiting = self._waiting, []
                for each in waiting:
                    if each.may_go(readers):
                        ready.append(each)
                    elif time.monotonic() < each.until_s:
                        self._waiting.append(each)
                left = len(self._waiting)
            for each in ready:
                self._send(each)

    def _send(self, waiting: _Waiting) -> None:
        try:
            self._send_response(waiting.response, waiting.header)
        except (InvalidHandle, RCLError) as error:
            log.warning("response not sent", service=self._name, reason=str(error))

    def _readers(self) -> set[bytes] | None:
        """GUIDs of all that read responses of this service; None when the node is gone.

        ``Node.get_subscriptions_info_by_topic`` has the same in public, in three times the time.
        """
        topic = f"rr{self._name}Reply"
        try:
            with self._node.handle:
                found = rclpy_get_subscriptions_info_by_topic(self._node.handle, topic, True)
        except (InvalidHandle, RCLError):
            return None
        return {bytes(each["endpoint_gid"]) for each in found}


class _Waiting(NamedTuple):
    """A response; ``until_s`` is of the monotonic clock."""

    response: Any
    header: Any
    reader: bytes
    until_s: float

    def may_go(self, readers: set[bytes] | None) -> bool:
        """Whether it is not going to wait: where the node is gone, to send says so at once."""
        return readers is None or self.reader in readers


class _RequestId(ctypes.Structure):
    """``rmw_request_id_t``, of which rclpy shows the number alone."""

    _fields_ = (("guid", ctypes.c_uint8 * 16), ("sequence_number", ctypes.c_int64))


def reader_of(header: Any) -> bytes | None:
    """GUID of the reader that waits for the response, 16 bytes; None when it cannot be told.

    Args:
        header: of the request, ``rmw_service_info_t`` or ``rmw_request_id_t`` of rclpy.
    """
    request = getattr(header, "request_id", header)
    # pybind11 keeps the address of the C++ object behind the head of the Python object.
    address = ctypes.c_void_p.from_address(id(request) + object.__basicsize__).value
    if not address:
        return None
    identity = _RequestId.from_address(address)
    if identity.sequence_number != request.sequence_number:
        return None
    guid = bytes(identity.guid)
    return guid if guid[-1] & _READER else None
