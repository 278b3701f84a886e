"""Goal requests that stay C messages until the goal is read.

Works around: rclpy makes Python objects of a goal before its server can answer, four arrays and a
duration for each point. The answer needs the identity of the goal alone.
Measured: 0.5 ms at best and 1.2 ms at the median of 2.9 ms from a request with 20 points of six
joints to its answer (x86_64, two cores at load 16).
Upstream: none known.
Ends with: no version yet.
Shown by: tests/ros/test_goal_requests.py, tools/bench/goal_client.py.
"""

from __future__ import annotations

import ctypes
from functools import cached_property
from typing import Any

from robotd.clock import NANOSECONDS
from robotd_ros.middleware.rcl_error import RCLError
from robotd_ros.middleware.release_gil import MessageFunctions, RequestId, c_function, last_error

_OK, _TAKE_FAILED = 0, 2201  # rcl_action/types.h
_UUID_BYTES = 16


class GoalRequest:
    """Request of a goal; ``goal`` converts it when it is first read.

    One thread at a time.

    Attributes:
        requester: identity of the request.
        goal_id: of the goal, 16 bytes.

    Args:
        message: address of the C message, which is freed with this object.
        requester: identity of the request.
    """

    def __init__(self, message: int, functions: MessageFunctions, requester: RequestId) -> None:
        self.requester = requester
        # The first field of ``SendGoal_Request`` in every action.
        self.goal_id = ctypes.string_at(message, _UUID_BYTES)
        self._message: int | None = message
        self._functions = functions

    def __del__(self) -> None:
        self._free()

    @cached_property
    def goal(self) -> Any:
        """Goal of the action's type."""
        request = self._functions.to_python(self._message)
        self._free()
        return request.goal

    def _free(self) -> None:
        message, self._message = self._message, None
        if message is not None:
            self._functions.destroy(message)


class GoalRequests:
    """Takes and answers the goal requests of an action server. Executor thread.

    Raises InternalsError: rcl or rclpy have other internals.
    """

    def __init__(self, action_type: Any) -> None:
        arguments = [ctypes.c_void_p, ctypes.POINTER(RequestId), ctypes.c_void_p]
        take, answer = "rcl_action_take_goal_request", "rcl_action_send_goal_response"
        self._take = c_function("librcl_action.so", take, arguments)
        self._answer = c_function("librcl_action.so", answer, arguments)
        self._requests = MessageFunctions(action_type.Impl.SendGoalService.Request)

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
                status = self._take(handle.pointer, ctypes.byref(requester), message)
        finally:
            if status != _OK:
                self._requests.destroy(message)
        if status == _OK:
            return GoalRequest(message, self._requests, requester)
        reason = last_error()
        if status == _TAKE_FAILED:
            return None
        raise RCLError(f"goal request not taken: {reason}")

    def answer(self, handle: Any, request: GoalRequest, accepted_ns: int | None) -> None:
        """Send the answer to ``request``. Raises RCLError: it was not sent.

        Args:
            handle: of the action server, from rclpy.
            request: from ``take``.
            accepted_ns: ROS time at which the goal was accepted; None: it is rejected.
        """
        response = _Response()
        if accepted_ns is not None:
            response.accepted = True
            response.sec, response.nanosec = divmod(accepted_ns, NANOSECONDS)
        with handle:
            status = self._answer(
                handle.pointer, ctypes.byref(request.requester), ctypes.byref(response)
            )
            if status != _OK:
                raise RCLError(last_error())


class _Response(ctypes.Structure):
    """``SendGoal_Response`` of every action."""

    _fields_ = (("accepted", ctypes.c_bool), ("sec", ctypes.c_int32), ("nanosec", ctypes.c_uint32))
