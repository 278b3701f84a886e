"""Topic wmx/robot/status, and the units of WMX R2: mm, degrees, roll, pitch, yaw (u, v, w)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from wmx_r2_message.msg import RobotStatus

from robotd.api import FloatArray, InvalidArgument, ProcessImage
from robotd.api.robots import Robot
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_tool_space.node_settings import RobotOptionSettings
from robotd_tool_space.r2_motion import R2Motion
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.rotations import inverse_pose, pose_of, rpy_of

TOPIC = "wmx/robot/status"
DEPTH = 1
MM_M = 1e-3
FACTORS = {"rad": np.pi / 180.0, "m": MM_M}


def pose_of_r2(message: Any) -> FloatArray:
    """Return a RobotCartesianPose as a pose (4, 4), m. Raises InvalidArgument: not finite."""
    for component in "xyzuvw":
        if not np.isfinite(value := getattr(message, component)):
            raise InvalidArgument(f"{component} of the pose is {value}, must be a finite number")
    place = np.array([message.x, message.y, message.z])
    return pose_of(MM_M * place, np.radians([message.u, message.v, message.w]))


def fill_r2_pose(message: Any, pose: FloatArray) -> None:
    """Set a RobotCartesianPose to a pose (4, 4), m. At a pitch of a quarter turn u is 0."""
    message.x, message.y, message.z = map(float, pose[:3, 3] / MM_M)
    message.u, message.v, message.w = map(float, np.degrees(rpy_of(pose)))


def r2_factors(units: Sequence[str]) -> FloatArray:
    """Return what a degree or mm of each joint is, (n,), in its unit, rad or m."""
    return np.array([FACTORS[unit] for unit in units])


def joints_of_r2(values: Sequence[float], names: Sequence[str], factors: FloatArray) -> FloatArray:
    """Return positions (n,), rad or m, of values in degrees or mm.

    Args:
        values: one for each joint.
        names: of the joints.
        factors: see ``r2_factors``.

    Raises InvalidArgument: another number of values, or one that is not finite.
    """
    if len(values) != len(names):
        raise InvalidArgument(f"target_joint has {len(values)} values for {len(names)} joints")
    for name, value in zip(names, values, strict=True):
        if not np.isfinite(value):
            raise InvalidArgument(f"target_joint of {name} is {value}, must be a finite number")
    return np.array(values) * factors


class R2StatusTopic:
    """Publishes the status while it has subscribers and the positions are known. Executor thread.

    Attributes:
        is_active: the robot is registered; without one nothing is published. Any thread writes it.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        tool: RobotTool,
        motion: R2Motion,
        settings: RobotOptionSettings,
    ) -> None:
        self.is_active = True
        self._robot, self._tool, self._motion, self._settings = robot, tool, motion, settings
        self._axes = list(tool.group.joint_axes)
        self._factors = r2_factors(tool.kinematics.units)
        self._clock = node.get_clock()
        self._publisher = node.create_publisher(RobotStatus, TOPIC, DEPTH)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # no clock jump stops it
        self._timer = node.create_timer(1.0 / settings.status_hz, self._publish, clock=steady)

    def _publish(self) -> None:
        if not (self.is_active and self._publisher.get_subscription_count()):
            return
        image = self._robot.image.copy()
        if self._robot.connection.ready and np.isfinite(image.position[self._axes]).all():
            publish_if_alive(self._publisher, self._message(image))

    def _message(self, image: ProcessImage) -> RobotStatus:
        settings, tool, axes = self._settings, self._tool, self._axes
        message = RobotStatus(robot_id=settings.robot_id)
        message.header.stamp = self._clock.now().to_msg()
        message.header.frame_id = settings.prefix + (tool.work_frame_name or tool.base)
        state, fault = self._motion.state(image)
        message.motion_state, message.motion_error_code = int(state), int(fault.code)
        message.motion_error_joint = fault.joint
        base, kinematics = inverse_pose(tool.work_frame), tool.kinematics
        for suffix, positions, velocities in (
            ("cmd", image.position_command[axes], image.velocity_command[axes]),
            ("fb", image.position[axes], image.velocity[axes]),
        ):
            fill_r2_pose(
                getattr(message, f"tool_pose_{suffix}"), base @ kinematics.forward(positions)
            )
            setattr(message, f"joint_pos_{suffix}", (positions / self._factors).tolist())
            setattr(message, f"joint_velocity_{suffix}", (velocities / self._factors).tolist())
        message.joint_torque_fb = image.torque[axes].tolist()
        return message
