"""follow_joint_trajectory_server: trajectory actions, and the gripper's service."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from std_srvs.srv import SetBool

from robotd.control.joint_group import JointGroups
from robotd.log import get_logger
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
from robotd_ros.nodes.trajectory_action import TrajectoryAction
from robotd_ros.services import add_service

NAME = "follow_joint_trajectory_server"

log = get_logger("trajectory")


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
        for each in parameters:
            value = each.value
            is_tolerance = each.name in self._values and each.name != END_VELOCITY
            if is_tolerance and not (math.isfinite(value) and value >= 0.0):
                what = f"{each.name}: {value} is not a finite number of at least 0"
                return SetParametersResult(successful=False, reason=what)
        return SetParametersResult(successful=True)

    def _changed(self, parameters: Sequence[Any]) -> None:
        changed = {each.name: each.value for each in parameters if each.name in self._values}
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
