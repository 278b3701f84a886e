"""Topics with the values of the process image, published by the control loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from numpy.typing import NDArray
from rclpy.node import Node

from robotd.device.process_image import ProcessImage
from robotd.robot import Robot
from robotd_ros.middleware import HotPublisher, StampClock


class HotTopics:
    """Topics whose messages are filled and published together.

    Nothing is published without subscribers, nor while the engine is not ready: old values
    must not look current. ``publish`` is a task of the control loop; the rest is done before.

    Attributes:
        topics: their resolved names.
        age_ns: time from that of the values to the start of the period; ``fill`` may set it.
    """

    def __init__(self, node: Node, robot: Robot) -> None:
        self.topics: list[str] = []
        self.age_ns = 0
        self._node = node
        self._connection, self._control_loop = robot.connection, robot.control_loop
        self._clock = StampClock(node.get_clock())
        self._messages: list[tuple[HotPublisher, bool]] = []  # and whether it is stamped

    def add(
        self,
        topic: str,
        depth: int,
        template: Any,
        views: Iterable[str] = (),
        *,
        sources: Mapping[str, NDArray[Any]] = MappingProxyType({}),
        stamped: bool = True,
    ) -> HotPublisher:
        """Add a topic, see ``HotPublisher``; ``stamped``: with the time of the values."""
        message = HotPublisher(self._node, topic, depth, template, views, sources)
        self.topics.append(message.topic)
        self._messages.append((message, stamped))
        return message

    def fill(self, image: ProcessImage) -> bool:
        """Write values into views and sources; return False where they are not known."""
        return True

    def publish(self, image: ProcessImage) -> None:
        """Publish the image of the present period."""
        if not self._connection.ready:
            return
        wanted = [message for message in self._messages if message[0].has_readers]
        if not wanted or not self.fill(image):
            return
        stamp_ns = self._clock.at_ns(self._control_loop.started_ns) - self.age_ns
        for message, is_stamped in wanted:
            if is_stamped:
                message.stamp(stamp_ns)
            message.publish()
