"""Topic wmx/robot/status: state, poses and joints in the units of WMX R2."""

from __future__ import annotations

import numpy as np
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from wmx_r2_message.msg import RobotStatus

from robotd.api import ProcessImage
from robotd.api.robots import Robot
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_tool_space.r2_motion import R2Motion
from robotd_tool_space.r2_settings import RobotOptionSettings
from robotd_tool_space.r2_units import fill_r2_pose, r2_factors
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.rotations import inverse_pose

TOPIC = "wmx/robot/status"
DEPTH = 1


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
