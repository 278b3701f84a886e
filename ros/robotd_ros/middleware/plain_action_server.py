"""Action server by the public interface of rclpy alone, where ``action_server`` does not fit it.

Works around: the internals that ``WorkerActionServer`` replaces change between versions of rclpy.
Measured: what ``action_server`` and ``goal_requests`` say is lost, and with it the name of the
client that sent a goal.
Upstream: see ``action_server``.
Shown by: tests/ros/test_plain_rclpy.py.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, TypedDict, Unpack

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from robotd_ros.qos import SERVICE


class GoalCallbacks(TypedDict):
    """What an action server calls.

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
