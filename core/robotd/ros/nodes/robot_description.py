"""The robot's URDF as a latched topic and a parameter, as robot_state_publisher has them."""

from __future__ import annotations

from rclpy.node import Node
from std_msgs.msg import String

from robotd.export import ExportInput
from robotd.export.urdf_export import urdf
from robotd.robot import Robot
from robotd.ros.nodes.node_parameters import Parameters
from robotd.ros.nodes.ready_topic import LATCHED

TOPIC = "robot_description"


def publish_description(node: Node, robot: Robot, parameters: Parameters) -> None:
    """Declare the parameter and publish it once, latched; an empty one is not published.

    Raises DescriptorError where the robot's URDF cannot be read.
    """
    own = urdf(ExportInput(robot.descriptor)) if robot.descriptor.urdf else ""
    text = parameters.text(TOPIC, own, "the URDF; empty: not published")
    if text:
        node.create_publisher(String, TOPIC, LATCHED).publish(String(data=text))
