"""The robot's URDF as a latched topic, as robot_state_publisher has it."""

from __future__ import annotations

from rclpy.node import Node
from std_msgs.msg import String

from robotd.ros.qos import LATCHED

TOPIC = "robot_description"


def publish_description(node: Node, description: str) -> None:
    """Publish a URDF once, latched; an empty one is not published."""
    if description:
        node.create_publisher(String, TOPIC, LATCHED).publish(String(data=description))
