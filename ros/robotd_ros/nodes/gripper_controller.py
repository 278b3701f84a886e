"""gripper_controller: the gripper as GripperCommand and ParallelGripperCommand actions."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from control_msgs.action import GripperCommand, ParallelGripperCommand
from rclpy.node import Node

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.gripper import Gripper, GripperState
from robotd.device.servo_gripper import ServoGripper
from robotd.errors import DescriptorError, InvalidArgument
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.arm_settings import read_gripper_controller
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.worker_action import WorkerAction

log = get_logger("gripper")

NAME = "gripper_controller"
AnyGripper = Gripper | ServoGripper


class GripperController(Node):
    """Moves the grippers for MoveIt's gripper controllers.

    Raises DescriptorError: the robot has no gripper, or a parameter is wrong.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        if not (grippers := robot.grippers):
            raise DescriptorError(f"{NAME} needs a gripper, which {robot.descriptor.name} has not")
        settings = read_settings(self, robot.descriptor, read_gripper_controller)
        self._actions = [
            GripperAction(self, host, gripper, action_type, name, wanted, fill)
            for of, gripper in grippers.items()
            for action_type, name, wanted, fill in (
                (GripperCommand, settings[of].single, _wanted, _fill),
                (
                    ParallelGripperCommand,
                    settings[of].parallel,
                    _wanted_in_parallel,
                    _fill_in_parallel,
                ),
            )
            if name
        ]


class GripperAction(WorkerAction):
    """One action of the gripper; each goal runs until standstill.

    Args:
        host: its workers move the gripper.
        wanted: returns position and force of the gripper in a goal; raises InvalidArgument.
        fill: fills a result or a feedback from finger names and a state.
    """

    def __init__(
        self,
        node: Node,
        host: RosHost,
        gripper: AnyGripper,
        action_type: Any,
        name: str,
        wanted: Callable[[Any, AnyGripper], tuple[float, float]],
        fill: Callable[[Any, AnyGripper, GripperState], None],
    ) -> None:
        self._gripper, self._wanted, self._fill = gripper, wanted, fill
        super().__init__(node, host, action_type, name, log)

    def check(self, request: Any) -> None:
        with self._host.callback_guard():
            self._wanted(request.goal, self._gripper)

    def execute(self, goal: Any, result: Any, after: ExitStack) -> tuple[Outcome, str]:
        target, force_n = self._wanted(goal.request, self._gripper)

        def canceled() -> bool:
            return bool(goal.is_cancel_requested)

        if isinstance(self._gripper, ServoGripper):
            state = self._gripper.move(target, canceled)
        else:
            state = self._gripper.move(target, canceled, force_n)
        self._fill(result, self._gripper, state)
        return Outcome.SUCCEEDED if state.at_rest else Outcome.CANCELED, str(state)


def _wanted(request: Any, gripper: AnyGripper) -> tuple[float, float]:
    position_m = gripper.checked(float(request.command.position))
    return position_m, _force(gripper, float(request.command.max_effort))


def _wanted_in_parallel(request: Any, gripper: AnyGripper) -> tuple[float, float]:
    force_n = max(map(float, request.command.effort), default=0.0)
    return _position_in_parallel(request, gripper), _force(gripper, force_n)


def _force(gripper: AnyGripper, force_n: float) -> float:
    return gripper.checked_force(force_n) if isinstance(gripper, Gripper) else 0.0


def _position_in_parallel(request: Any, gripper: AnyGripper) -> float:
    """Return the position of the gripper; without names one position is that of the gripper."""
    names, positions = list(request.command.name), list(request.command.position)
    if not names and len(positions) == 1:
        return gripper.checked(float(positions[0]))
    names = names or list(gripper.joints)
    if len(positions) != len(names):
        raise InvalidArgument(f"{len(positions)} positions for {len(names)} joints")
    if len(set(names)) < len(names):
        raise InvalidArgument(f"a joint is given twice: {', '.join(names)}")
    return gripper.checked_fingers(dict(zip(names, positions, strict=True)))


def _fill(message: Any, gripper: AnyGripper, state: GripperState) -> None:
    message.position = state.position_m
    message.stalled, message.reached_goal = state.stalled, state.reached


def _fill_in_parallel(message: Any, gripper: AnyGripper, state: GripperState) -> None:
    message.state.name = list(gripper.joints)
    fingers = (
        gripper.finger_positions if gripper.is_measured else gripper.multipliers * state.position_m
    )
    message.state.position = fingers.tolist()
    message.state.velocity = [0.0] * len(gripper.joints)
    message.stalled, message.reached_goal = state.stalled, state.reached
