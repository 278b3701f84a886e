"""Latched topic: owner of each joint and wheel."""

from __future__ import annotations

from rclpy.node import Node
from std_msgs.msg import String

from robotd.device.process_image import ProcessImage
from robotd.robot import Robot
from robotd.ros.nodes.ready_topic import publish_if_alive
from robotd.ros.qos import LATCHED

TOPIC = "~/owners"
RATE_HZ = 10.0


class OwnerTopic:
    """Publishes ``joint: owner`` of the axes that have one, a line each, on every change."""

    def __init__(self, node: Node, robot: Robot) -> None:
        self._axes = robot.axes
        self._publisher = node.create_publisher(String, TOPIC, LATCHED)
        self._text: str | None = None
        rate_hz = min(RATE_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "owners", self.publish, first=True)

    def publish(self, image: ProcessImage) -> None:
        """Publish the owners where they have changed. Control loop."""
        owners = [self._axes.owner(axis) for axis in range(len(self._axes))]
        text = "\n".join(
            f"{name}: {owner}"
            for name, owner in zip(self._axes.names, owners, strict=True)
            if owner
        )
        if text != self._text:
            self._text = text
            publish_if_alive(self._publisher, String(data=text))
