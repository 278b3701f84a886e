"""Goal requests that stay C messages until the goal is read.

Works around: rclpy makes Python objects of a goal before its server can answer, four arrays and a
duration for each point. The answer needs the identity of the goal alone.
Measured: 0.5 ms at best and 1.2 ms at the median of 2.9 ms from a request with 20 points of six
joints to its answer (x86_64, two cores at load 16).
Upstream: none known.
Shown by: tests/ros/test_goal_requests.py, tools/bench/goal_client.py.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cached_property
from typing import Any

import numpy as np
from rclpy._rclpy_pybind11 import RCLError
from unique_identifier_msgs.msg import UUID

from robotd.ros.middleware.release_gil import MessageFunctions, RequestId, last_error

_OK, _TAKE_FAILED = 0, 2201  # rcl_action/types.h
_UUID_BYTES = 16


class GoalRequest:
    """Request of a goal; ``goal`` converts it when it is first read.

    One thread at a time.

    Attributes:
        requester: identity of the request.
        goal_id: of the goal.

    Args:
        message: address of the C message, which is freed with this object.
        functions: of its type.
        requester: as above.
    """

    def __init__(self, message: int, functions: MessageFunctions, requester: RequestId) -> None:
        self.requester = requester
        # The first field of ``SendGoal_Request`` in every action.
        self.goal_id = UUID(uuid=np.frombuffer(ctypes.string_at(message, _UUID_BYTES), np.uint8))
        self._message, self._functions = message, functions
        self._free = weakref.finalize(self, functions.destroy, message)
        self._free.atexit = False

    @cached_property
    def goal(self) -> Any:
        """Goal of the action's type."""
        request = self._functions.to_python(self._message)
        self._free()
        return request.goal


class GoalRequests:
    """Takes and answers the goal requests of an action server. Executor thread.

    Args:
        action_type: class of the action.
    """

    def __init__(self, action_type: Any) -> None:
        service = action_type.Impl.SendGoalService
        self._requests = MessageFunctions(service.Request)
        self._responses = MessageFunctions(service.Response)
        self._make_response = service.Response

    def take(self, handle: Any) -> GoalRequest | None:
        """Return the next request; None where none waits.

        Raises RCLError: it cannot be taken.

        Args:
            handle: of the action server, from rclpy.
        """
        requester, message = RequestId(), self._requests.create()
        status = None
        try:
            with handle:
                status = _rcl.rcl_action_take_goal_request(
                    handle.pointer, ctypes.byref(requester), message
                )
        finally:
            if status != _OK:
                self._requests.destroy(message)
        if status == _OK:
            return GoalRequest(message, self._requests, requester)
        reason = last_error()
        if status == _TAKE_FAILED:
            return None
        raise RCLError(f"goal request not taken: {reason}")

    def answer(self, handle: Any, request: GoalRequest, stamp: Any, *, accepted: bool) -> None:
        """Send the answer to ``request``. Raises RCLError: it was not sent."""
        response = self._make_response(accepted=accepted, stamp=stamp)
        with self._responses.converted(response) as message, handle:
            status = _rcl.rcl_action_send_goal_response(
                handle.pointer, ctypes.byref(request.requester), message
            )
            if status != _OK:
                raise RCLError(last_error())


_rcl = ctypes.CDLL("librcl_action.so")  # rclpy has loaded it
for _function in (_rcl.rcl_action_take_goal_request, _rcl.rcl_action_send_goal_response):
    _function.argtypes = [ctypes.c_void_p, ctypes.POINTER(RequestId), ctypes.c_void_p]
