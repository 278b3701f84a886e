"""follow_joint_trajectory_server: trajectory actions, and the gripper's service."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any

from control_msgs.action import FollowJointTrajectory
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from std_srvs.srv import SetBool

from robotd.control.groups.joint_group import JointGroup, JointGroups
from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import NotReady
from robotd.log import get_logger
from robotd.motion import TrajectoryRejected
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.arm_settings import (
    END_VELOCITY,
    GOAL_TIME,
    goal_name,
    path_name,
    read_trajectory_server,
)
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.nodes.trajectory_conversions import (
    TrajectoryFeedback,
    duration_s,
    joint_tolerances,
    refuse_unsupported,
    start_time_ns,
    trajectory_request,
)
from robotd_ros.services import add_service
from robotd_ros.worker_action import WorkerAction

NAME = "follow_joint_trajectory_server"

log = get_logger("trajectory")
_RESULT = FollowJointTrajectory.Result
# A fault and a preemption have no code of their own; clients know INVALID_GOAL for both.
_CODES = {
    Outcome.SUCCEEDED: _RESULT.SUCCESSFUL,
    Outcome.CANCELED: _RESULT.SUCCESSFUL,
    Outcome.PREEMPTED: _RESULT.INVALID_GOAL,
    Outcome.PATH_TOLERANCE: _RESULT.PATH_TOLERANCE_VIOLATED,
    Outcome.GOAL_TOLERANCE: _RESULT.GOAL_TOLERANCE_VIOLATED,
    Outcome.CONTACT: _RESULT.SUCCESSFUL,
    Outcome.STOPPED: _RESULT.INVALID_GOAL,
    Outcome.FAULT: _RESULT.INVALID_GOAL,
}


class FollowJointTrajectoryServer(Node):
    """Serves the trajectory action of each joint group, and the gripper's service.

    Raises DescriptorError: a parameter is wrong.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        self._robot = robot
        settings = read_settings(self, robot.descriptor, read_trajectory_server)
        if settings.gripper:
            add_service(self, host, SetBool, settings.gripper, self._set_gripper)
        self._constraints = ConstraintParameters(self, robot.groups, settings.constraints)
        self._actions = [
            TrajectoryAction(self, robot, host, robot.groups[group], action)
            for group, action in settings.actions.items()
        ]

    def _set_gripper(self, request: Any, response: Any) -> str:
        if self._robot.gripper is None:
            return self._move_servo_gripper(closes=request.data)
        self._robot.gripper.command(request.data)
        return "gripper closes" if request.data else "gripper opens"

    def _move_servo_gripper(self, *, closes: bool) -> str:
        """Worker: open or close the only gripper that is a joint, until it rests."""
        (gripper,) = self._robot.servo_grippers.values()
        state = gripper.move(gripper.checked(gripper.closed_m if closes else gripper.open_m))
        if not state.at_rest:
            raise NotReady(f"{gripper.name}: another command has replaced it")
        if state.stalled:
            return f"{gripper.name} is stalled at {state.position_m:.3g}, as by a part"
        return f"{gripper.name} is {'closed' if closes else 'open'}"


class ConstraintParameters:
    """Applies the parameters that ``ros2 param set`` changes to the goals that follow.

    Executor thread.

    Args:
        node: has declared the parameters.
        values: at the start, by name.
    """

    def __init__(self, node: Node, groups: JointGroups, values: Mapping[str, Any]) -> None:
        self._groups, self._values = groups, dict(values)
        self._apply()
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._changed)

    def _check(self, parameters: Sequence[Any]) -> SetParametersResult:
        for parameter in parameters:
            value = parameter.value
            is_tolerance = parameter.name in self._values and parameter.name != END_VELOCITY
            if is_tolerance and not (math.isfinite(value) and value >= 0.0):
                what = f"{parameter.name}: {value} is not a finite number of at least 0"
                return SetParametersResult(successful=False, reason=what)
        return SetParametersResult(successful=True)

    def _changed(self, parameters: Sequence[Any]) -> None:
        changed = {
            parameter.name: parameter.value
            for parameter in parameters
            if parameter.name in self._values
        }
        if changed:
            self._values.update(changed)
            self._apply()
            log.info("settings of goals changed", **changed)

    def _apply(self) -> None:
        for group in self._groups.values():
            names = group.joint_names
            group.follower.allow_end_velocity(self._values[END_VELOCITY])
            group.follower.set_default_tolerances(
                [self._limit(path_name(name)) for name in names],
                [self._limit(goal_name(name)) for name in names],
                self._limit(GOAL_TIME),
            )

    def _limit(self, name: str) -> float:
        """Return a tolerance; inf where it is not checked."""
        return self._values[name] or math.inf


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
                # Joints that move on after the last point are released after the result: the next
                # goal of the client may take over.
                after.push(joints.pop_all())
        return outcome, result.error_string

    def fill_failure(self, result: Any, error: Exception, text: str) -> None:
        result.error_code = _RESULT.INVALID_GOAL
        if isinstance(error, TrajectoryRejected):
            result.error_code = int(error.code)
        result.error_string = text
