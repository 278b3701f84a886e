"""Latched topics: readiness for commands, the URDF, the log; publishing for the life of a node."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from typing import Any, Self

from rcl_interfaces.msg import Log
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Bool, String

from robotd import log
from robotd.clock import NANOSECONDS
from robotd.device.connection import Connection
from robotd_ros.middleware import NODE_GONE
from robotd_ros.qos import LATCHED, ROSOUT

PERIOD_S = 1.0
LEVELS = {"debug": Log.DEBUG, "info": Log.INFO, "warning": Log.WARN, "critical": Log.FATAL}


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


class RosoutTopic:
    """Publishes the lines of the log: ``with RosoutTopic(node):``.

    Each is published by the thread that logs it; the name is that of the node, a dot, and the
    component.
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(Log, "/rosout", ROSOUT)
        self._name = node.get_logger().name

    def __enter__(self) -> Self:
        log.add_listener(self._publish)
        return self

    def __exit__(self, *_: object) -> None:
        log.remove_listener(self._publish)

    def _publish(self, line: log.LogLine) -> None:
        message = Log(
            level=LEVELS.get(line.level, Log.ERROR),
            name=f"{self._name}.{line.component}",
            msg=line.text,
        )
        message.stamp.sec, message.stamp.nanosec = divmod(time.time_ns(), NANOSECONDS)
        publish_if_alive(self._publisher, message)
