"""Client of a service that costs next to nothing.

The request is converted before the clock starts, sent by rcl and awaited in a wait set of one
client, as a C program would do it; rclpy's clients would add half a millisecond.
"""

from __future__ import annotations

import ctypes
import time
from typing import Any

from rclpy._rclpy_pybind11 import WaitSet
from rclpy.client import Client
from rclpy.node import Node

WAIT_S = 20.0
_rcl = ctypes.CDLL("librcl.so")
_rcl.rcl_send_request.argtypes = [
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.POINTER(ctypes.c_int64),
]
_capsule = ctypes.pythonapi.PyCapsule_GetPointer
_capsule.argtypes, _capsule.restype = [ctypes.py_object, ctypes.c_char_p], ctypes.c_void_p


class FastClient:
    """A service's client: ``prepare`` a request, ``send`` it, ``receive`` the response."""

    def __init__(self, node: Node, service_type: Any, name: str) -> None:
        self._client: Client = node.create_client(service_type, name)
        assert self._client.wait_for_service(WAIT_S), f"no service {name}"
        self._type = service_type
        self._context = node.context
        support: Any = type(service_type.Request)
        support.__import_type_support__()
        self._create = ctypes.CFUNCTYPE(ctypes.c_void_p)(_address(support, "_CREATE_ROS_MESSAGE"))
        self._convert = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)(
            _address(support, "_CONVERT_FROM_PY")
        )

    def prepare(self, request: Any) -> int:
        """Return the C message of ``request``; it is never freed."""
        message = self._create()
        assert self._convert(request, message)
        return int(message)

    def send(self, message: int) -> int:
        """Send; return the time just before, ns."""
        number = ctypes.c_int64()
        start_ns = time.perf_counter_ns()
        with self._client.handle:
            assert not _rcl.rcl_send_request(
                self._client.handle.pointer, message, ctypes.byref(number)
            )
        return start_ns

    def receive(self) -> tuple[int, Any]:
        """Wait for the response; return the time of its arrival, ns, and it."""
        deadline = time.monotonic() + WAIT_S
        while time.monotonic() < deadline:
            with self._client.handle, self._context.handle:
                wait_set = WaitSet(0, 0, 0, 1, 0, 0, self._context.handle)
                with wait_set:
                    wait_set.clear_entities()
                    wait_set.add_client(self._client.handle)
                    wait_set.wait(int(0.5e9))
                arrived_ns = time.perf_counter_ns()
                header, response = self._client.handle.take_response(self._type.Response)
            if header is not None:
                return arrived_ns, response
        raise TimeoutError(self._client.srv_name)


def _address(support: Any, name: str) -> int:
    return int(_capsule(getattr(support, name), None))
