"""manipulator_state: joint states at the feedback rate, republished for simulators."""

from __future__ import annotations

import math

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from robotd.arrays import FloatArray
from robotd.device.process_image import ProcessImage, columns
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.arm_settings import ManipulatorStateSettings, read_manipulator_state
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.nodes.latched_topics import publish_description
from robotd_ros.nodes.node_parameters import read_settings

NAME = "manipulator_state"
DEPTH = 10


class ManipulatorState(Node):
    """Node that publishes arm joints and gripper fingers from the control loop.

    With this node in the set, the robot's joints are switched on at start.

    Raises DescriptorError: a parameter is wrong; nothing was opened.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        settings = read_settings(self, robot.descriptor, read_manipulator_state)
        if robot.gripper is not None:
            robot.gripper.configure(settings.open_m, settings.closed_m)
        topics = JointStateTopics(self, robot, settings)
        if settings.parameters_file:
            robot.connection.parameters_file = settings.parameters_file
        publish_description(self, settings.description)
        robot.control_loop.every(settings.rate_hz, "joint states", topics.publish)
        self.rates_hz = dict.fromkeys(topics.topics, float(settings.rate_hz))


class JointStateTopics(HotTopics):
    """Joint states in up to three types of message."""

    def __init__(self, node: Node, robot: Robot, settings: ManipulatorStateSettings) -> None:
        super().__init__(node, robot)
        self._slow = robot.axes.feedback_period_s > 0.0  # stamps are those of the values
        self._joints = len(robot.joint_axes)
        self._gripper = robot.gripper
        self._finger_m = 0.0
        self._positions: list[FloatArray] = []  # of each message
        self._index = columns(robot.joint_axes)
        self._measured: FloatArray = robot.image.measured[:, self._index]
        self._is_gathered = not isinstance(self._index, slice)  # the axes are not side by side
        if self._is_gathered:
            self._measured = np.ascontiguousarray(self._measured)
        names, rest = list(settings.names), [0.0] * len(settings.names)
        full = JointState(name=names, position=rest, velocity=rest)
        full.effort = [math.nan] * len(names)  # N·m; nothing measures the fingers' force
        # Without effort, for a reader that takes it as a command.
        bare = JointState(name=names, position=rest, velocity=rest)
        for topic, template, fields in (
            (settings.joint_states, full, ("position", "velocity", "effort")),
            (settings.unstamped, bare, ("position", "velocity")),
            (settings.positions, Float64MultiArray(data=rest), ("data",)),
        ):
            if topic:
                sources = dict(zip(fields, self._measured, strict=False))
                stamped = template is full
                message = self.add(topic, DEPTH, template, sources=sources, stamped=stamped)
                self._positions.append(message.view(fields[0]))

    def fill(self, image: ProcessImage) -> bool:
        if self._slow:
            self.age_ns = max(0, image.stamp_ns - image.fresh_ns)
        if self._is_gathered:
            self._measured[:] = image.measured[:, self._index]
        gripper = self._gripper
        if gripper is not None and gripper.is_measured:
            fingers = gripper.finger_positions
            for positions in self._positions:
                positions[self._joints :] = fingers
        elif gripper is not None and (position_m := gripper.position_m) != self._finger_m:
            self._finger_m = position_m
            for positions in self._positions:
                np.multiply(gripper.multipliers, position_m, positions[self._joints :])
        return True
