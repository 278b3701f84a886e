"""Action servers whose goals are executed by workers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy._rclpy_pybind11 import GoalEvent
from rclpy.action import CancelResponse, GoalResponse
from rclpy.node import Node

from robotd.ros.middleware import RealTimeResultServer
from robotd.ros.services import SERVICE_QOS

# Real time for which a result can be asked for, with its goal in memory: the default of rcl.
# rclpy's own, 15 min, is 150 MB when goals of 1000 points come one a second.
RESULT_TIMEOUT_S = 10


class WorkerActionServer(RealTimeResultServer):
    """Action server that leaves accepted goals to ``accepted``; ``notify_execute`` ends them.

    A coroutine that awaits a worker would be the ordinary way, but the EventsExecutor spins for
    as long as one waits: half a core while the robot moves.

    Args:
        node: serves the action.
        action_type: class of the action.
        name: of the action.
        admit: decides about a ``GoalRequest``; its ``goal`` is converted when it is read.
            Executor thread.
        accepted, cancel: callbacks of rclpy with a goal handle, in the executor thread.
    """

    def __init__(
        self,
        node: Node,
        action_type: Any,
        name: str,
        *,
        admit: Callable[[Any], GoalResponse],
        accepted: Callable[[Any], None],
        cancel: Callable[[Any], CancelResponse],
    ) -> None:
        super().__init__(
            node,
            action_type,
            name,
            _unused,
            goal_callback=admit,
            handle_accepted_callback=accepted,
            cancel_callback=cancel,
            goal_service_qos_profile=SERVICE_QOS,
            cancel_service_qos_profile=SERVICE_QOS,
            result_service_qos_profile=SERVICE_QOS,
            result_timeout=RESULT_TIMEOUT_S,
        )


def begin(goal: Any) -> None:
    """Mark an accepted goal as executing. Executor thread."""
    goal._update_state(GoalEvent.EXECUTE)  # noqa: SLF001 - execute() would do it at the end


def _unused(goal: Any) -> Any:
    """The execute callback that rclpy asks for."""
    raise AssertionError("goals are executed by a worker")
