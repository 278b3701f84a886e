"""FollowJointTrajectory action of a joint group."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

from control_msgs.action import FollowJointTrajectory
from rclpy.node import Node

from robotd.control.completion import Outcome
from robotd.control.joint_group import JointGroup
from robotd.log import get_logger
from robotd.motion import TrajectoryRejected
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.trajectory_conversions import (
    TrajectoryFeedback,
    duration_s,
    joint_tolerances,
    refuse_unsupported,
    start_time_ns,
    trajectory_request,
)
from robotd_ros.worker_action import WorkerAction

log = get_logger("trajectory")

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


class TrajectoryAction(WorkerAction):
    """Executes one trajectory of a joint group at a time; a newer goal takes over.

    Args:
        host: its workers execute goals.
    """

    # The status that every client gets lists all goals, so that a thousand at once, each of which
    # changes it three times, would keep all clients busy for minutes.
    max_active = 32

    def __init__(
        self, node: Node, robot: Robot, host: RosHost, group: JointGroup, action: str
    ) -> None:
        self._robot, self._group = robot, group
        self._clock = node.get_clock()  # of ROS
        own_log = log.bind(group=group.name) if robot.descriptor.groups else log
        super().__init__(node, host, FollowJointTrajectory, action, own_log)

    def arrived(self, goal: Any) -> tuple[int]:
        return (self._group.motion.ticket(),)

    def execute(self, goal: Any, result: Any, after: ExitStack, ticket: int) -> tuple[Outcome, str]:
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
            feedback = TrajectoryFeedback(execution.trajectory.names)
            self.watch(
                goal,
                execution,
                self._robot.clock,
                lambda: feedback.fill(execution.progress(), self._clock.now().nanoseconds),
            )
            outcome, text = execution.outcome or Outcome.FAULT, execution.message
            result.error_code = _CODES[outcome]
            if outcome is Outcome.CANCELED and not goal.is_cancel_requested:
                result.error_code = _RESULT.INVALID_GOAL
                text = "stopped by the robot, not by the client"
            notes = (*execution.trajectory.notes, *tolerances.notes)
            result.error_string = "; ".join([text, *notes])
            if not execution.done:
                # Joints that move on behind the last point are released after the result: the next
                # goal of the client may take over.
                after.push(joints.pop_all())
        return outcome, result.error_string

    def fill_failure(self, result: Any, error: Exception, text: str) -> None:
        result.error_code = _RESULT.INVALID_GOAL
        if isinstance(error, TrajectoryRejected):
            result.error_code = int(error.code)
        result.error_string = text
