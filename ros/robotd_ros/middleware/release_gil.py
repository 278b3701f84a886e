"""``rcl_send_response`` with the interpreter released.

Works around: rclpy holds the interpreter for as long as the call takes, up to 100 ms, and with it
the control loop. The three functions of a message that rclpy calls too are found where rclpy finds
them.
Measured: during one such call another thread that sleeps 1 ms at a time runs 90 times, and 15
times with the interpreter held.
Upstream: https://github.com/ros2/rclpy/issues/1025 (the same for ``take_message``; open).
Ends with: no version yet.
Where rclpy or rcl have other internals, ``InternalsError`` says so before anything is called.
Shown by: tests/ros/test_service_responses.py, tests/ros/test_plain_rclpy.py.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.service import Service

_HEADER_BYTES = 56  # of an object of pybind11 2: head, value, holder, weak references, flags


class InternalsError(Exception):
    """rclpy or rcl have other internals than this package knows."""


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
    if type(request).__basicsize__ != _HEADER_BYTES:
        return None
    # pybind11 keeps the address of the C++ object after the header of the Python object.
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

    Raises InternalsError: its class has no such capsules.
    """

    def __init__(self, message_type: Any) -> None:
        support: Any = type(message_type)
        try:
            support.__import_type_support__()
            create, destroy, to_python, from_python = (
                _pointer_in(getattr(support, name), None) for name in _CAPSULES
            )
        except (AttributeError, ValueError) as error:
            raise InternalsError(f"{message_type.__name__}: {error}") from error
        self.create, self.destroy = _CREATE(create), _DESTROY(destroy)
        self.to_python, self._from_python = _TO_PYTHON(to_python), _FROM_PYTHON(from_python)

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
    """Sends the responses of one service. Any thread; one at a time.

    Raises InternalsError: rcl or rclpy have other internals.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._type = service.srv_type.Response
        self._lock = threading.Lock()
        self._functions = MessageFunctions(self._type)
        arguments = [ctypes.c_void_p, ctypes.POINTER(RequestId), ctypes.c_void_p]
        self._send = c_function("librcl.so", "rcl_send_response", arguments)

    def __call__(self, response: Any, request: RequestId) -> str:
        """Send; return the reason of a failure, "" for none.

        Raises:
            TypeError: ``response`` has another type than the service.
            rclpy.exceptions.InvalidHandle: the service is gone.
        """
        if not isinstance(response, self._type):
            raise TypeError(f"{type(response).__name__} is not {self._type.__name__}")
        service = self._service.handle
        with self._functions.converted(response) as message, service, self._lock:
            status = self._send(service.pointer, ctypes.byref(request), message)
            return last_error() if status else ""


class _ErrorString(ctypes.Structure):
    """``rcutils_error_string_t``."""

    _fields_ = (("text", ctypes.c_char * 1024),)


def c_function(
    library: str, name: str, arguments: Sequence[Any], result: Any = ctypes.c_int
) -> Any:
    """Return a function of a library that rclpy has loaded; raises InternalsError."""
    try:
        function = getattr(ctypes.CDLL(library), name)
    except (AttributeError, OSError) as error:
        raise InternalsError(str(error)) from error
    function.argtypes, function.restype = arguments, result
    return function


def last_error() -> str:
    """Return the text of rcl's last error in this thread."""
    text: bytes = c_function("librcutils.so", "rcutils_get_error_string", [], _ErrorString)().text
    c_function("librcutils.so", "rcutils_reset_error", [], None)()
    return text.decode(errors="replace")


_CAPSULES = "_CREATE_ROS_MESSAGE", "_DESTROY_ROS_MESSAGE", "_CONVERT_TO_PY", "_CONVERT_FROM_PY"
_pointer_in = ctypes.pythonapi.PyCapsule_GetPointer
_pointer_in.argtypes, _pointer_in.restype = [ctypes.py_object, ctypes.c_char_p], ctypes.c_void_p
_CREATE = ctypes.CFUNCTYPE(ctypes.c_void_p)
_FROM_PYTHON = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)
_TO_PYTHON = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_DESTROY = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
