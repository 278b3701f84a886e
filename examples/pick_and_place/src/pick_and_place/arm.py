"""The arm as this application sees it: an action for its joints, and one for its gripper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from trajectory_msgs.msg import JointTrajectoryPoint

ACTION = "/movensys_manipulator_arm_controller/follow_joint_trajectory"
GRIPPER = "/gripper_controller/gripper_cmd"
OPEN_M, CLOSED_M = 0.0, 0.045  # of the fingers
JOINTS = [f"joint{number}" for number in range(1, 7)]
ANSWER_S = 20.0


class ArmFailed(Exception):
    """The arm did not do what it was asked; the text is the robot's reason."""


class Arm:
    """``with Arm() as arm:`` A ROS node of its own, one thread; every call waits for its end."""

    def __enter__(self) -> Self:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("pick_and_place", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._action = ActionClient(self._node, FollowJointTrajectory, ACTION)
        self._gripper = ActionClient(self._node, GripperCommand, GRIPPER)
        if not all(client.wait_for_server(ANSWER_S) for client in (self._action, self._gripper)):
            raise ArmFailed("no robot answers")
        return self

    def __exit__(self, *_: object) -> None:
        self._action.destroy()
        self._gripper.destroy()
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def move(self, positions_rad: Sequence[float], time_s: float) -> None:
        """Bring all joints to ``positions_rad``. Raises ArmFailed."""
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = JOINTS
        time = Duration(sec=int(time_s), nanosec=round(time_s % 1 * 1e9))
        goal.trajectory.points = [
            JointTrajectoryPoint(positions=list(positions_rad), time_from_start=time)
        ]
        handle = self._wait(self._action.send_goal_async(goal))
        result = self._wait(handle.get_result_async()).result
        if result.error_code != FollowJointTrajectory.Result.SUCCESSFUL:
            raise ArmFailed(result.error_string)

    def grip(self, *, closed: bool) -> None:
        """Close the gripper, or open it, until the fingers rest. Raises ArmFailed."""
        goal = GripperCommand.Goal()
        goal.command.position = CLOSED_M if closed else OPEN_M
        handle = self._wait(self._gripper.send_goal_async(goal))
        result = self._wait(handle.get_result_async()).result
        if not (result.reached_goal or (closed and result.stalled)):
            raise ArmFailed(f"the gripper stopped at {result.position:.4f} m")

    def _wait(self, future: Any) -> Any:
        self._executor.spin_until_future_complete(future, ANSWER_S)
        if not future.done():
            raise ArmFailed(f"no answer within {ANSWER_S:g} s")
        return future.result()
