"""Topic with the poses of the tools, for ``robotd status`` and other clients."""

from __future__ import annotations

from collections.abc import Iterator

from geometry_msgs.msg import TransformStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from robotd.arrays import FloatArray
from robotd.descriptor.urdf import transform_numbers
from robotd.robot import Robot
from robotd_ros.nodes.latched_topics import publish_if_alive

TOPIC = "~/tool_pose"
RATE_HZ = 10.0


class ToolPoseTopic:
    """Publishes the pose of each tool at 10 Hz while there are subscribers. Executor thread.

    Poses that are not known are left out.

    Args:
        prefix: put before the names of the frames.
    """

    def __init__(self, node: Node, robot: Robot, prefix: str) -> None:
        self._prefix = prefix
        self._tools, self._image, self._connection = robot.tools, robot.image, robot.connection
        self._clock = node.get_clock()
        self._publisher = node.create_publisher(TFMessage, TOPIC, 1)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # no clock jump stops it
        self._timer = node.create_timer(1.0 / RATE_HZ, self._publish, clock=steady)

    def _publish(self) -> None:
        if self._publisher.get_subscription_count():
            poses = list(self._poses()) if self._connection.ready else []
            publish_if_alive(self._publisher, TFMessage(transforms=poses))

    def _poses(self) -> Iterator[TransformStamped]:
        image, stamp = self._image.copy(), self._clock.now().to_msg()
        for tool in self._tools:
            if (frame := tool.frame(image)) is not None:
                message = TransformStamped(child_frame_id=self._prefix + tool.link)
                message.header.frame_id, message.header.stamp = self._prefix + tool.base, stamp
                fill_transform(message, transform_numbers(frame))
                yield message


def fill_transform(message: TransformStamped, numbers: FloatArray) -> None:
    """Set x, y, z and the quaternion x, y, z, w; ``numbers`` of shape (7,)."""
    x, y, z, qx, qy, qz, qw = map(float, numbers)
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = x, y, z
    turn.x, turn.y, turn.z, turn.w = qx, qy, qz, qw
