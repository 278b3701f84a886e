"""FollowJointTrajectory action of a joint group."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from control_msgs.action import FollowJointTrajectory
from rclpy.action import CancelResponse, GoalResponse
from rclpy.node import Node

from robotd.control.joint_group import JointGroup
from robotd.control.trajectory_execution import Outcome, TrajectoryExecution
from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.motion import Tolerances, TrajectoryRejected
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.middleware import worker_action_server
from robotd_ros.nodes.trajectory_conversions import (
    TrajectoryFeedback,
    duration_s,
    joint_tolerances,
    refuse_unsupported,
    start_time_ns,
    trajectory_request,
)

log = get_logger("trajectory")

FEEDBACK_PERIOD_NS = 40_000_000  # of the robot's clock
# Beyond it a goal is rejected. The status that every client gets lists all goals, so that a
# thousand at once, each of which changes it three times, would keep all clients busy for minutes.
MAX_ACTIVE_GOALS = 32

_RESULT = FollowJointTrajectory.Result
# A fault and a preemption have no code of their own; clients know INVALID_GOAL for both.
_CODES = {
    Outcome.SUCCEEDED: _RESULT.SUCCESSFUL,
    Outcome.CANCELED: _RESULT.SUCCESSFUL,
    Outcome.PREEMPTED: _RESULT.INVALID_GOAL,
    Outcome.PATH_TOLERANCE: _RESULT.PATH_TOLERANCE_VIOLATED,
    Outcome.GOAL_TOLERANCE: _RESULT.GOAL_TOLERANCE_VIOLATED,
    Outcome.STOPPED: _RESULT.INVALID_GOAL,
    Outcome.FAULT: _RESULT.INVALID_GOAL,
}


@dataclass(frozen=True)
class Ending:
    """Outcome and result of a goal; ``outcome`` None: rejected before anything moved."""

    outcome: Outcome | None
    code: int
    text: str


class TrajectoryAction:
    """Executes one trajectory of a joint group at a time; a newer goal takes over.

    A bad goal is accepted and aborted at once, because only a result can carry a reason. One too
    many is rejected, see ``MAX_ACTIVE_GOALS``.

    Args:
        node: serves the action.
        robot: of the group.
        host: its workers execute goals.
        group: executes the trajectories.
        action: name.
    """

    def __init__(
        self, node: Node, robot: Robot, host: RosHost, group: JointGroup, action: str
    ) -> None:
        self._robot, self._host, self._group = robot, host, group
        self._clock = node.get_clock()  # of ROS
        self._log = log.bind(group=group.name) if robot.descriptor.groups else log
        self._executions: dict[bytes, TrajectoryExecution] = {}
        self._live = 0  # goals that have not ended; executor thread
        self._server = worker_action_server(
            node,
            FollowJointTrajectory,
            action,
            admit=self._admit,
            accepted=self._accepted,
            cancel=self._cancel,
        )

    def _admit(self, request: Any) -> GoalResponse:
        if self._live >= MAX_ACTIVE_GOALS:
            reason = f"{MAX_ACTIVE_GOALS} goals have not ended yet"
            self._log.warning("goal rejected", reason=reason)
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _cancel(self, goal: Any) -> CancelResponse:
        if execution := self._executions.get(bytes(goal.goal_id.uuid)):
            execution.cancel()
        return CancelResponse.ACCEPT

    def _accepted(self, goal: Any) -> None:
        """Executor thread: hand the goal to a worker. The client has its answer already."""
        self._live += 1
        with self._host.callback_guard():
            try:
                ticket = self._group.motion.ticket()
                self._host.submit(self._run, goal, ticket)
            except RobotdError as error:
                self._end(goal, self._failure(error))

    def _run(self, goal: Any, ticket: int) -> None:
        """Worker thread: execute the goal, then let the executor thread end it."""
        with self._host.sent_by_request(goal.requester), ExitStack() as motion:
            try:
                ending = self._follow(goal, ticket, motion)
            except Exception as error:  # noqa: BLE001 - the goal ends with it
                ending = self._failure(error)
            finally:
                self._executions.pop(bytes(goal.goal_id.uuid), None)
            # Joints that move on behind the last point are released after the result: the next
            # goal of the client may take over.
            self._end(goal, ending)

    def _failure(self, error: Exception) -> Ending:
        if isinstance(error, RobotdError):
            code = error.code if isinstance(error, TrajectoryRejected) else _RESULT.INVALID_GOAL
            return Ending(None, int(code), str(error))
        self._log.error("a goal failed", exc_info=error)
        return Ending(None, _RESULT.INVALID_GOAL, f"internal error: {error}")

    def _end(self, goal: Any, ending: Ending) -> None:
        self._server.notify_execute(goal, lambda goal: self._finish(goal, ending))

    def _finish(self, goal: Any, ending: Ending) -> Any:
        """Executor thread. The goal ends here only, so after ``_cancel`` is through."""
        self._live -= 1
        word = ending.outcome.name.lower() if ending.outcome else "rejected"
        if ending.outcome is Outcome.SUCCEEDED:
            goal.succeed()
        elif ending.outcome is Outcome.CANCELED and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
            if ending.outcome is Outcome.CANCELED:  # by the robot
                word = "aborted"
        self._log.info("goal ended", outcome=word, reason=ending.text)
        return _RESULT(error_code=ending.code, error_string=ending.text)

    def _follow(self, goal: Any, ticket: int, motion: ExitStack) -> Ending:
        message, follower = goal.request, self._group.follower
        refuse_unsupported(message)
        request = trajectory_request(message.trajectory)
        tolerances = follower.tolerances(
            joint_tolerances(message.path_tolerance),
            joint_tolerances(message.goal_tolerance),
            duration_s(message.goal_time_tolerance),
        )
        start_ns = start_time_ns(message.trajectory, self._clock, self._robot.clock)
        with ExitStack() as joints:
            execution = joints.enter_context(follower.follow(request, tolerances, start_ns, ticket))
            self._executions[bytes(goal.goal_id.uuid)] = execution
            self._watch(goal, execution)
            ending = _ending(goal, execution, tolerances)
            if not execution.done:
                motion.push(joints.pop_all())
        return ending

    def _watch(self, goal: Any, execution: TrajectoryExecution) -> None:
        """Publish feedback until the goal has ended."""
        feedback = TrajectoryFeedback(execution.trajectory.names)
        with execution.ticks(FEEDBACK_PERIOD_NS, self._robot.clock) as ticks:
            for _ in ticks:
                if goal.is_cancel_requested:  # before it was in the table
                    execution.cancel()
                now_ns = self._clock.now().nanoseconds
                goal.publish_feedback(feedback.fill(execution.progress(), now_ns))


def _ending(goal: Any, execution: TrajectoryExecution, tolerances: Tolerances) -> Ending:
    outcome, text = execution.outcome or Outcome.FAULT, execution.message
    code = _CODES[outcome]
    if outcome is Outcome.CANCELED and not goal.is_cancel_requested:
        code, text = _RESULT.INVALID_GOAL, "stopped by the robot, not by the client"
    notes = (*execution.trajectory.notes, *tolerances.notes)
    return Ending(outcome, code, "; ".join([text, *notes]))
