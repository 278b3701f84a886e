"""Actions whose goals workers execute, and the executor thread ends."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Protocol

from rclpy.action import CancelResponse, GoalResponse
from rclpy.node import Node

from robotd.clock import Clock
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.errors import OperationError, RobotdError
from robotd.log import shortened
from robotd_ros.host import RosHost
from robotd_ros.middleware import release_request, worker_action_server

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

FEEDBACK_PERIOD_NS = 40_000_000  # of the robot's clock


class Cancelable(Protocol):
    """Execution that any thread can stop."""

    def cancel(self) -> None: ...


class WorkerAction(ABC):
    """Action of a node. Methods are for the executor thread, unless it says otherwise.

    A bad goal is accepted and aborted at once, because only a result can carry a reason. One too
    many is rejected.

    Args:
        host: its workers execute goals.

    Attributes:
        max_active: goals that may not have ended.
    """

    max_active = 8

    def __init__(
        self, node: Node, host: RosHost, action_type: Any, name: str, log: FilteringBoundLogger
    ) -> None:
        self._host, self._type, self._log = host, action_type, log
        self._executions: dict[bytes, Cancelable] = {}
        self._live = 0  # goals that have not ended
        self._server = worker_action_server(
            node,
            action_type,
            name,
            admit=self._admit,
            accepted=self._accepted,
            cancel=self._cancel,
        )

    def check(self, request: Any) -> None:  # noqa: B027 - most goals are judged by a worker
        """Raise RobotdError for a goal that is rejected at once."""

    def arrived(self, goal: Any) -> tuple[Any, ...]:
        """Return what ``execute`` needs of the order in which goals arrive.

        Raises RobotdError with the reason of an aborted goal.
        """
        return ()

    @abstractmethod
    def execute(
        self, goal: Any, result: Any, after: ExitStack, *arrived: Any
    ) -> tuple[Outcome, str]:
        """Worker: execute a goal; return its outcome and a text for the log.

        Args:
            goal: from rclpy.
            after: closed after the goal has ended.
            arrived: of ``arrived``.

        Raises an exception for a goal that is aborted; nothing moves then.
        """

    def fill_failure(  # noqa: B027 - a result may have no text
        self, result: Any, error: Exception, text: str
    ) -> None:
        """Say in ``result`` why a goal was aborted."""

    def watch(
        self, goal: Any, execution: TrajectoryExecution, clock: Clock, feedback: Callable[[], Any]
    ) -> None:
        """Worker: publish ``feedback`` until the outcome of ``execution`` is known.

        The client can cancel it from now on.
        """
        self.let_cancel(goal, execution)
        with execution.ticks(FEEDBACK_PERIOD_NS, clock) as ticks:
            for _ in ticks:
                goal.publish_feedback(feedback())

    def let_cancel(self, goal: Any, execution: Cancelable) -> None:
        """Worker: let the client cancel the goal by stopping ``execution`` from now on."""
        self._executions[bytes(goal.goal_id.uuid)] = execution
        if goal.is_cancel_requested:  # before it was in the table
            execution.cancel()

    def _admit(self, request: Any) -> GoalResponse:
        try:
            self._check_room()
            self.check(request)
        except Exception as error:  # noqa: BLE001 - logged and answered
            self._host.request_log.rejected(request.requester, "goal rejected", error, self._log)
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _check_room(self) -> None:
        if self._live >= self.max_active:
            raise OperationError(f"{self.max_active} goals have not ended yet")

    def _cancel(self, goal: Any) -> CancelResponse:
        if execution := self._executions.get(bytes(goal.goal_id.uuid)):
            execution.cancel()
        return CancelResponse.ACCEPT

    def _accepted(self, goal: Any) -> None:
        """Hand a goal to a worker. The client has its answer already."""
        self._live += 1
        with self._host.callback_guard():
            try:
                self._host.submit(self._run, goal, self.arrived(goal), until_rest=True)
            except Exception as error:  # noqa: BLE001 - the goal ends with it
                self._abort(goal, self._type.Result(), error)

    def _run(self, goal: Any, arrived: tuple[Any, ...]) -> None:
        """Worker: execute a goal, then let the executor thread end it."""
        result = self._type.Result()
        with self._host.sent_by_request(goal.requester), ExitStack() as after:
            try:
                if goal.is_cancel_requested:  # while it waited for a worker
                    outcome, text = Outcome.CANCELED, "canceled before it began"
                else:
                    outcome, text = self.execute(goal, result, after, *arrived)
            except Exception as error:  # noqa: BLE001 - the goal ends with it
                self._abort(goal, result, error)
            else:
                self._end(goal, outcome, result, text)

    def _abort(self, goal: Any, result: Any, error: Exception) -> None:
        self._host.request_log.rejected(goal.requester, "goal aborted", error, self._log)
        text = shortened(str(error))
        if not isinstance(error, RobotdError):
            text = f"internal error: {text}"
        self.fill_failure(result, error, text)
        self._end(goal, None, result, text)

    def _end(self, goal: Any, outcome: Outcome | None, result: Any, text: str) -> None:
        """End a goal in the executor thread, so after ``_cancel`` is through. Any thread."""
        self._executions.pop(bytes(goal.goal_id.uuid), None)

        def finish(goal: Any) -> Any:
            self._live -= 1
            release_request(goal)
            if outcome is Outcome.SUCCEEDED:
                goal.succeed()
            elif outcome is Outcome.CANCELED and goal.is_cancel_requested:
                goal.canceled()
            else:
                goal.abort()
            if outcome is not None:
                by_robot = outcome is Outcome.CANCELED and not goal.is_cancel_requested
                word = "aborted" if by_robot else outcome.name.lower()
                self._log.info("goal ended", outcome=word, reason=text)
            return result

        self._server.notify_execute(goal, finish)
