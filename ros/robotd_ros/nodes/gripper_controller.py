"""gripper_controller: the gripper as GripperCommand and ParallelGripperCommand actions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from control_msgs.action import GripperCommand, ParallelGripperCommand
from rclpy.action import CancelResponse, GoalResponse
from rclpy.node import Node

from robotd.device.gripper import Gripper, GripperState
from robotd.errors import DescriptorError, InvalidArgument, RobotdError
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.middleware import worker_action_server
from robotd_ros.nodes.command_settings import read_gripper_controller
from robotd_ros.nodes.node_parameters import read_settings

log = get_logger("gripper")

NAME = "gripper_controller"
MAX_ACTIVE_GOALS = 8


class GripperController(Node):
    """Opens and closes the gripper for MoveIt's gripper controllers.

    Raises:
        DescriptorError: the robot has no gripper, or a parameter is wrong.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        if robot.gripper is None:
            raise DescriptorError(f"{NAME} needs a gripper, which {robot.descriptor.name} has not")
        single, parallel = read_settings(self, robot.descriptor, read_gripper_controller)
        self._actions = [
            GripperAction(self, host, robot.gripper, action_type, name, wanted, fill)
            for action_type, name, wanted, fill in (
                (GripperCommand, single, _wanted, _fill),
                (ParallelGripperCommand, parallel, _wanted_in_parallel, _fill_in_parallel),
            )
            if name
        ]


class GripperAction:
    """One action of the gripper; each goal runs in a worker until standstill.

    Args:
        node: its owner.
        host: its workers move the gripper.
        gripper: to be moved.
        action_type: class of the action.
        name: of the action.
        wanted: returns the position of the gripper in a goal; raises InvalidArgument.
        fill: fills a result or a feedback from finger names and a state.
    """

    def __init__(
        self,
        node: Node,
        host: RosHost,
        gripper: Gripper,
        action_type: Any,
        name: str,
        wanted: Callable[[Any, Gripper], float],
        fill: Callable[[Any, Gripper, GripperState], None],
    ) -> None:
        self._host, self._gripper, self._type = host, gripper, action_type
        self._wanted, self._fill = wanted, fill
        self._live = 0  # goals that have not ended; executor thread
        self._server = worker_action_server(
            node,
            action_type,
            name,
            admit=self._admit,
            accepted=self._accepted,
            cancel=lambda goal: CancelResponse.ACCEPT,
        )

    def _admit(self, request: Any) -> GoalResponse:
        with self._host.callback_guard():
            try:
                if self._live >= MAX_ACTIVE_GOALS:
                    raise InvalidArgument(f"{MAX_ACTIVE_GOALS} goals have not ended yet")
                self._wanted(request.goal, self._gripper)
            except RobotdError as error:
                log.warning("goal rejected", reason=str(error))
                return GoalResponse.REJECT
            return GoalResponse.ACCEPT

    def _accepted(self, goal: Any) -> None:
        """Executor thread: hand the goal to a worker."""
        self._live += 1
        try:
            self._host.submit(self._run, goal)
        except RobotdError as error:
            self._end(goal, None, str(error))

    def _run(self, goal: Any) -> None:
        """Worker: move, and let the executor thread end the goal."""
        try:
            target = self._wanted(goal.request, self._gripper)
            state = self._gripper.move(target, lambda: bool(goal.is_cancel_requested))
        except RobotdError as error:
            self._end(goal, None, str(error))
        except Exception as error:
            log.exception("gripper goal failed")
            self._end(goal, None, f"internal error: {error}")
        else:
            self._end(goal, state, "")

    def _end(self, goal: Any, state: GripperState | None, reason: str) -> None:
        self._server.notify_execute(goal, lambda goal: self._finish(goal, state, reason))

    def _finish(self, goal: Any, state: GripperState | None, reason: str) -> Any:
        """Executor thread."""
        self._live -= 1
        result = self._type.Result()
        if state is not None:
            self._fill(result, self._gripper, state)
        if goal.is_cancel_requested and state is not None and not state.at_rest:
            goal.canceled()
        elif state is None or not state.at_rest:
            goal.abort()
        else:
            goal.succeed()
        log.info("gripper goal ended", reason=reason or str(state))
        return result


def _wanted(request: Any, gripper: Gripper) -> float:
    return gripper.checked(float(request.command.position))


def _wanted_in_parallel(request: Any, gripper: Gripper) -> float:
    """Return the position of the gripper; without names one position is that of the gripper."""
    names, positions = list(request.command.name), list(request.command.position)
    if not names and len(positions) == 1:
        return gripper.checked(float(positions[0]))
    names = names or list(gripper.joints)
    if len(positions) != len(names):
        raise InvalidArgument(f"{len(positions)} positions for {len(names)} joints")
    return gripper.checked_fingers(dict(zip(names, positions, strict=True)))


def _fill(message: Any, gripper: Gripper, state: GripperState) -> None:
    message.position = state.position_m
    message.stalled, message.reached_goal = state.stalled, state.reached


def _fill_in_parallel(message: Any, gripper: Gripper, state: GripperState) -> None:
    message.state.name = list(gripper.joints)
    fingers = (
        gripper.finger_positions if gripper.is_measured else gripper.multipliers * state.position_m
    )
    message.state.position = fingers.tolist()
    message.state.velocity = [0.0] * len(gripper.joints)
    message.stalled, message.reached_goal = state.stalled, state.reached
