"""Action server that answers goal and cancel requests before all that can wait.

Works around: rclpy formats each request as the text of a debug message that is not shown, with the
16 numbers of the goal's id, and publishes the status of all goals before it answers a cancel. It
does not pass on who sent a goal, and converts goals before it answers (``goal_requests.py``).
And it expires results by the node's clock: at ``--time-scale max`` 10 s of that are 0.3 s of real
time, and a client that asks for a result later than that gets UNKNOWN.
Measured: acceptance of a goal of 20 points 2.0 ms instead of 3.2 ms, answer to a cancel 0.9 ms
instead of 2.2 ms (medians of tools/bench/goal_client.py, in C, x86_64, two cores shared with other
work). In simulated time 17 of 70 goals lost their results.
Upstream: https://github.com/ros2/rclpy/issues/1236 (goals that expire in fast simulated time;
closed), https://github.com/ros2/rcl/issues/1103 (start of the time-out of results; closed); for the
rest none known.
Ends with: no version yet.
Where rclpy has other internals than those of ``_INTERNALS``, ``PlainActionServer`` serves goals by
the public interface alone: what is measured here is lost, and the name of a goal's client.
Shown by: tests/ros/test_simulated_time.py, tests/ros/test_plain_rclpy.py.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from types import SimpleNamespace
from typing import Any, TypedDict, Unpack

import numpy as np
from action_msgs.msg import GoalInfo
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action import server as rclpy_server
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.task import Future

from robotd.clock import NANOSECONDS
from robotd.log import get_logger
from robotd_ros.middleware.goal_requests import GoalRequest, GoalRequests
from robotd_ros.middleware.rcl_error import RCLError
from robotd_ros.middleware.release_gil import InternalsError, RequestId
from robotd_ros.middleware.stamp_clock import StampClock
from robotd_ros.qos import SERVICE

log = get_logger("ros")

GoalEvent: Any = getattr(rclpy_server, "GoalEvent", None)  # see ``_INTERNALS``

# Real time for which a result can be asked for, with its goal in memory: the default of rcl.
# rclpy's own, 15 min, is 150 MB when goals of 1000 points come one a second.
RESULT_TIMEOUT_S = 10

# Functions of rclpy that are replaced or relied on, with names that they use.
_INTERNALS = (
    (ActionServer, "__init__", "_lock _handle _action_type _goal_handles _result_futures"),
    (ActionServer, "is_ready", "_is_goal_request_ready"),
    (ActionServer, "take_data", "_is_goal_request_ready"),
    (ActionServer, "execute", "_execute_goal_request _execute_cancel_request"),
    (ActionServer, "_execute_goal_request", "_goal_callback _handle_accepted_callback"),
    (ActionServer, "_execute_cancel_request", "_cancel_callback process_cancel_request GoalEvent"),
    (ServerGoalHandle, "__init__", "_goal_handle _action_server _goal_request _lock"),
    (ServerGoalHandle, "_update_state", "update_goal_state publish_status"),
)


class GoalCallbacks(TypedDict):
    """Functions that an action server calls.

    Attributes:
        admit: decides about a ``GoalRequest``; its ``goal`` is converted when it is read.
        accepted: gets the handle of an accepted goal, which executes.
        cancel: callback of rclpy with a goal handle.
    """

    admit: Callable[[Any], GoalResponse]
    accepted: Callable[[Any], None]
    cancel: Callable[[Any], CancelResponse]


class PlainActionServer(ActionServer):
    """Action server that leaves accepted goals to ``accepted``; ``notify_execute`` ends them.

    Args:
        node, action_type, name: see ``WorkerActionServer``.
        result_timeout_s: time for which a result can be asked for, by the node's clock.
        callbacks: a request has its ``goal`` only, and the ``requester`` of a goal is not known.
    """

    def __init__(
        self,
        node: Node,
        action_type: Any,
        name: str,
        *,
        result_timeout_s: int,
        **callbacks: Unpack[GoalCallbacks],
    ) -> None:
        self._accepted, admit = callbacks["accepted"], callbacks["admit"]
        super().__init__(
            node,
            action_type,
            name,
            lambda goal: action_type.Result(),
            goal_callback=lambda goal: admit(SimpleNamespace(goal=goal)),
            handle_accepted_callback=self._begin,
            cancel_callback=callbacks["cancel"],
            goal_service_qos_profile=SERVICE,
            cancel_service_qos_profile=SERVICE,
            result_service_qos_profile=SERVICE,
            result_timeout=result_timeout_s,
        )

    def notify_execute(self, goal: ServerGoalHandle, execute_callback: Any) -> None:
        """End a goal with the result of a callback; without one, its execution only begins."""
        if execute_callback is not None:
            super().notify_execute(goal, execute_callback)

    def _begin(self, goal: ServerGoalHandle) -> None:
        goal.requester = None
        goal.execute()
        self._accepted(goal)


def worker_action_server(
    node: Node, action_type: Any, name: str, **callbacks: Unpack[GoalCallbacks]
) -> ActionServer:
    """Return a ``WorkerActionServer``, or a ``PlainActionServer`` where rclpy has changed."""
    try:
        _check_internals()
        requests = GoalRequests(action_type)
    except InternalsError as error:
        log.warning("goals are served by plain rclpy", action=name, reason=str(error))
        return PlainActionServer(
            node, action_type, name, result_timeout_s=RESULT_TIMEOUT_S, **callbacks
        )
    return WorkerActionServer(node, action_type, name, requests, **callbacks)


def release_request(goal: ServerGoalHandle) -> None:
    """Free the content of a goal that has ended; its handle stays until the result expires."""
    goal._goal_request = None  # noqa: SLF001 - of both servers


def _check_internals() -> None:
    """Raises InternalsError: this rclpy has other internals."""
    for owner, function, names in _INTERNALS:
        code = getattr(getattr(owner, function, None), "__code__", None)
        if missing := {*names.split()} - {*(code.co_names if code else ())}:
            what = ", ".join(sorted(missing))
            raise InternalsError(f"{owner.__name__}.{function} does not use {what}")


class WorkerActionServer(ActionServer):
    """Action server that leaves accepted goals to ``accepted``; ``notify_execute`` ends them.

    A coroutine that awaits a worker would be the usual solution, but the EventsExecutor spins for
    as long as one waits: half a core while the robot moves.

    Args:
        node: serves the action; its clock gives the stamps.
        callbacks: plain functions, called in the executor thread.
    """

    _is_goal_request_ready: bool  # of rclpy

    def __init__(
        self,
        node: Node,
        action_type: Any,
        name: str,
        requests: GoalRequests,
        **callbacks: Unpack[GoalCallbacks],
    ) -> None:
        self._requests = requests
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)  # rcl keeps a bare pointer
        super().__init__(
            _NodeOnClock(node, self._steady_clock),
            action_type,
            name,
            _unused,
            goal_callback=callbacks["admit"],
            handle_accepted_callback=callbacks["accepted"],
            cancel_callback=callbacks["cancel"],
            goal_service_qos_profile=SERVICE,
            cancel_service_qos_profile=SERVICE,
            result_service_qos_profile=SERVICE,
            result_timeout=RESULT_TIMEOUT_S,
        )
        self._node = node

    def take_data(self) -> Any:
        """Take what is ready; a goal request is answered and its goal taken."""
        accepted = None
        if self._is_goal_request_ready:
            self._is_goal_request_ready = False
            with self._lock:
                request = self._requests.take(self._handle)
            if request is not None:
                now_ns = self._clock.now_ns()
                accepted = self._accepted(request, now_ns)
                stamp_ns = None if accepted is None else now_ns
                try:
                    self._requests.answer(self._handle, request, stamp_ns)
                except RCLError as error:
                    log.warning("goal not answered: its client has gone", reason=str(error))
                    if accepted is not None:
                        accepted._update_state(GoalEvent.EXECUTE)  # noqa: SLF001 - as below
                        self.notify_execute(accepted, self._abort)
                    accepted = None
        data = super().take_data() or {}
        if accepted is not None:
            data["goal"] = accepted
        return data

    def _abort(self, goal: ServerGoalHandle) -> Any:
        """End a goal that does not begin: one that has not ended would be kept for ever."""
        goal.abort()
        release_request(goal)
        return self._action_type.Result()

    async def _execute_goal_request(self, goal: ServerGoalHandle) -> None:
        """Publish the status of an accepted goal, begin its execution and hand it on.

        One that was canceled since it was taken goes on to its end without being executed.
        """
        self._handle.publish_status()
        if not goal.is_cancel_requested:
            goal._update_state(GoalEvent.EXECUTE)  # noqa: SLF001 - execute() would do it last
        self._handle_accepted_callback(goal)

    def _accepted(self, request: GoalRequest, now_ns: int) -> ServerGoalHandle | None:
        """Return the handle of a goal that is accepted, else None."""
        if self._goal_callback(request) is not GoalResponse.ACCEPT:
            return None
        info = GoalInfo()
        info.goal_id.uuid[:] = np.frombuffer(request.goal_id, np.uint8)
        info.stamp.sec, info.stamp.nanosec = divmod(now_ns, NANOSECONDS)
        try:
            with self._lock:
                goal = _GoalHandle(self, info, request)
        except RuntimeError as error:  # a goal of this id is known, or there is no memory
            log.error("goal not accepted", reason=str(error))
            return None
        result = Future()
        self._goal_handles[request.goal_id], self._result_futures[request.goal_id] = goal, result
        self.add_future(result)
        return goal

    @cached_property
    def _clock(self) -> StampClock:
        return StampClock(self._node.get_clock())

    async def _execute_cancel_request(self, request_header_and_message: Any) -> None:
        """Begin to cancel goals and answer; then publish their status."""
        header, request = request_header_and_message
        kind = self._action_type.Impl.CancelGoalService.Response
        with self._lock:
            response = self._handle.process_cancel_request(request, kind)
        response.goals_canceling = [
            info for info in response.goals_canceling if self._begins_cancel(info)
        ]
        try:
            self._handle.send_cancel_response(header, response)
        except RCLError as error:
            log.warning("cancel not answered: its client has gone", reason=str(error))
        if response.goals_canceling:
            self._handle.publish_status()

    def _begins_cancel(self, info: Any) -> bool:
        """Return True for a goal that its callback cancels and that has not ended meanwhile."""
        goal = self._goal_handles.get(bytes(info.goal_id.uuid))
        if goal is None or self._cancel_callback(goal) is not CancelResponse.ACCEPT:
            return False
        with goal._lock:  # noqa: SLF001 - as ``ServerGoalHandle._update_state``, without the status
            if goal._goal_handle is None:  # noqa: SLF001 - it has expired
                return False
            try:
                goal._goal_handle.update_goal_state(GoalEvent.CANCEL_GOAL)  # noqa: SLF001
            except RCLError:
                return False
        return True


class _GoalHandle(ServerGoalHandle):
    """Goal handle whose ``request`` is converted when it is first read.

    Its feedback message is made once: rclpy makes one with all its parts each time. One thread at
    a time.
    """

    _feedback: Any = None

    @property
    def request(self) -> Any:
        """Goal of the action's type."""
        return self._goal_request.goal

    @property
    def requester(self) -> RequestId:
        """Identity of the request, which names the client."""
        return self._goal_request.requester

    def publish_feedback(self, feedback: Any) -> None:
        """Publish ``feedback``, of the action's type; no effect after the goal has expired."""
        server = self._action_server
        if self._feedback is None:
            self._feedback = server.action_type.Impl.FeedbackMessage(goal_id=self.goal_id)
        self._feedback.feedback = feedback
        with self._lock:
            if self._goal_handle is not None:
                server._handle.publish_feedback(self._feedback)  # noqa: SLF001


class _NodeOnClock:
    """``node`` with another clock, while the server is made."""

    def __init__(self, node: Node, clock: Clock) -> None:
        self._wrapped = node
        self._clock = clock

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wrapped, name)

    def get_clock(self) -> Clock:
        return self._clock


def _unused(goal: Any) -> Any:
    """The execute callback that rclpy asks for."""
    raise AssertionError("goals are executed by a worker")
