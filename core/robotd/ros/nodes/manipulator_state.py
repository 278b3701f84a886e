"""manipulator_state: joint states at the feedback rate, republished for simulators."""

from __future__ import annotations

from rclpy.node import Node

from robotd.node_settings.arm_settings import read_manipulator_state
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.joint_state_topics import JointStateTopics
from robotd.ros.nodes.latched_topics import publish_description
from robotd.ros.nodes.node_parameters import read_settings

NAME = "manipulator_state"


class ManipulatorState(Node):
    """Node that publishes arm joints and gripper fingers from the control loop.

    With this node in the set, the robot's joints are switched on at start.

    Raises:
        DescriptorError: a parameter is wrong; nothing was opened.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        settings = read_settings(self, robot.descriptor, read_manipulator_state)
        topics = JointStateTopics(self, robot, settings)
        if settings.parameters_file:
            robot.connection.parameters.path = settings.parameters_file
        publish_description(self, settings.description)
        robot.control_loop.every(settings.rate_hz, "joint states", topics.publish)
        self.rates_hz = dict.fromkeys(topics.topics, float(settings.rate_hz))
