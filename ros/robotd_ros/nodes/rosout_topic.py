"""The log of robotd on ``/rosout``, as every ROS node has it."""

from __future__ import annotations

import time
from typing import Self

from rcl_interfaces.msg import Log
from rclpy.node import Node

from robotd import log
from robotd.clock import NANOSECONDS
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import ROSOUT

LEVELS = {"debug": Log.DEBUG, "info": Log.INFO, "warning": Log.WARN, "critical": Log.FATAL}


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
