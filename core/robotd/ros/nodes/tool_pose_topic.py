"""Topic with the pose of the tool, for ``robotd status`` and other clients."""

from __future__ import annotations

from geometry_msgs.msg import TransformStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from robotd.descriptor.urdf import transform_numbers
from robotd.robot import Robot
from robotd.ros.nodes.ready_topic import publish_if_alive

TOPIC = "~/tool_pose"
RATE_HZ = 10.0


class ToolPoseTopic:
    """Publishes the pose of the tool at 10 Hz while somebody subscribes. Executor thread.

    ``child_frame_id`` is empty while the pose is not known, and for a robot without one.

    Args:
        node: its owner.
        robot: with the tool.
        prefix: put before the names of the frames.
    """

    def __init__(self, node: Node, robot: Robot, prefix: str) -> None:
        self._prefix = prefix
        self._tool, self._connection = robot.tool, robot.connection
        self._clock = node.get_clock()
        self._publisher = node.create_publisher(TransformStamped, TOPIC, 1)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # no clock jump stops it
        self._timer = node.create_timer(1.0 / RATE_HZ, self._publish, clock=steady)

    def _publish(self) -> None:
        if self._publisher.get_subscription_count():
            publish_if_alive(self._publisher, self._message())

    def _message(self) -> TransformStamped:
        message = TransformStamped()
        message.header.stamp = self._clock.now().to_msg()
        tool = self._tool if self._connection.ready else None
        if tool is None or (frame := tool.frame()) is None:
            return message
        message.header.frame_id = self._prefix + tool.base
        message.child_frame_id = self._prefix + tool.link
        x, y, z, qx, qy, qz, qw = map(float, transform_numbers(frame))
        place, turn = message.transform.translation, message.transform.rotation
        place.x, place.y, place.z = x, y, z
        turn.x, turn.y, turn.z, turn.w = qx, qy, qz, qw
        return message
