"""Latched topics: readiness for commands and the URDF; publishing for the life of a node."""

from __future__ import annotations

import threading
from contextlib import suppress
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Bool, String

from robotd.device.connection import Connection
from robotd_ros.middleware import NODE_GONE
from robotd_ros.qos import LATCHED

PERIOD_S = 1.0


class ReadyTopic:
    """Publishes ``engine.ready`` on every change and once a second, for the life of the node."""

    def __init__(self, node: Node, connection: Connection, topic: str) -> None:
        self._connection = connection
        self._publisher = node.create_publisher(Bool, topic, LATCHED)
        self._lock = threading.Lock()
        # Wall time that no clock jump and no simulated clock can stop.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self._publish, clock=steady)
        connection.on_ready(lambda ready: self._publish())

    def _publish(self) -> None:
        """Publish the value that is current under the lock. Any thread."""
        with self._lock:
            publish_if_alive(self._publisher, Bool(data=self._connection.ready))


def publish_if_alive(publisher: Publisher, message: Any) -> None:
    """Publish, unless the node is gone; the robot outlives it where a program has both."""
    with suppress(*NODE_GONE):
        publisher.publish(message)


def publish_description(node: Node, description: str) -> None:
    """Publish a URDF once, as robot_state_publisher has it; an empty one is not published."""
    if description:
        node.create_publisher(String, "robot_description", LATCHED).publish(
            String(data=description)
        )
