"""``rcl_send_response`` with the interpreter released.

Works around: rclpy holds the interpreter for as long as the call takes, up to 100 ms, and with it
the control loop. The three functions of a message that rclpy calls too are found where rclpy finds
them.
Measured: during one such call another thread that sleeps 1 ms at a time runs 90 times, and 15
times with the interpreter held.
Upstream: https://github.com/ros2/rclpy/issues/1025 (the same for ``take_message``; open).
Shown by: tests/ros/test_service_responses.py.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.service import Service


class RequestId(ctypes.Structure):
    """``rmw_request_id_t``, of which rclpy shows the number alone."""

    _fields_ = (("guid", ctypes.c_uint8 * 16), ("sequence_number", ctypes.c_int64))


def request_id_of(header: Any) -> RequestId | None:
    """Return the identity of a request; None where it cannot be read.

    Args:
        header: of the request, ``rmw_service_info_t`` or ``rmw_request_id_t`` of rclpy, or its
            identity.
    """
    if isinstance(header, RequestId):
        return header
    request = getattr(header, "request_id", header)
    # pybind11 keeps the address of the C++ object behind the head of the Python object.
    address = ctypes.c_void_p.from_address(id(request) + object.__basicsize__).value
    if not address:
        return None
    identity = RequestId.from_address(address)
    if identity.sequence_number != request.sequence_number:
        return None
    return RequestId.from_buffer_copy(identity)


class MessageFunctions:
    """C functions of one type of message, from the capsules of its metaclass.

    Attributes:
        create: returns the address of an empty message.
        destroy: frees a message.
        to_python: returns the message at an address as an object.

    Args:
        message_type: class of the message.
    """

    def __init__(self, message_type: Any) -> None:
        support: Any = type(message_type)
        support.__import_type_support__()
        self.create = _CREATE(_pointer_in(support._CREATE_ROS_MESSAGE, None))  # noqa: SLF001
        self.destroy = _DESTROY(_pointer_in(support._DESTROY_ROS_MESSAGE, None))  # noqa: SLF001
        self.to_python = _TO_PYTHON(_pointer_in(support._CONVERT_TO_PY, None))  # noqa: SLF001
        self._from_python = _FROM_PYTHON(_pointer_in(support._CONVERT_FROM_PY, None))  # noqa: SLF001

    @contextmanager
    def converted(self, message: Any) -> Iterator[int]:
        """Yield the address of ``message`` as a C message, which is freed at the end."""
        address = self.create()
        try:
            self._from_python(message, address)
            yield address
        finally:
            self.destroy(address)


class ResponseSender:
    """Sends the responses of one service. Any thread; one at a time."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._type = service.srv_type.Response
        self._lock = threading.Lock()
        self._functions = MessageFunctions(self._type)

    def __call__(self, response: Any, request: RequestId) -> str:
        """Send; return the reason of a failure, "" for none.

        Raises:
            TypeError: ``response`` is of another type than the service's.
            rclpy.exceptions.InvalidHandle: the service is gone.
        """
        if not isinstance(response, self._type):
            raise TypeError(f"{type(response).__name__} is not {self._type.__name__}")
        service = self._service.handle
        with self._functions.converted(response) as message, service, self._lock:
            status = _rcl.rcl_send_response(service.pointer, ctypes.byref(request), message)
            return last_error() if status else ""


class _ErrorString(ctypes.Structure):
    """``rcutils_error_string_t``."""

    _fields_ = (("text", ctypes.c_char * 1024),)


def last_error() -> str:
    """Return the text of rcl's last error in this thread."""
    text: bytes = _rcutils.rcutils_get_error_string().text
    _rcutils.rcutils_reset_error()
    return text.decode(errors="replace")


_rcl, _rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")  # rclpy has loaded both
_rcl.rcl_send_response.argtypes = [ctypes.c_void_p, ctypes.POINTER(RequestId), ctypes.c_void_p]
_rcutils.rcutils_get_error_string.restype = _ErrorString
_pointer_in = ctypes.pythonapi.PyCapsule_GetPointer
_pointer_in.argtypes, _pointer_in.restype = [ctypes.py_object, ctypes.c_char_p], ctypes.c_void_p
_CREATE = ctypes.CFUNCTYPE(ctypes.c_void_p)
_FROM_PYTHON = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)
_TO_PYTHON = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_DESTROY = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
