"""follow_joint_trajectory_server: trajectory actions, and the gripper's service."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool

from robotd.node_settings.arm_settings import read_trajectory_server
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.constraint_parameters import ConstraintParameters
from robotd.ros.nodes.node_parameters import read_settings
from robotd.ros.nodes.trajectory_action import TrajectoryAction
from robotd.ros.services import add_service

NAME = "follow_joint_trajectory_server"


class FollowJointTrajectoryServer(Node):
    """Serves the trajectory action of each joint group, and the gripper's service.

    Raises:
        DescriptorError: a parameter is wrong.
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
        if self._robot.gripper is not None:
            self._robot.gripper.command(request.data)
        return "gripper closes" if request.data else "gripper opens"
