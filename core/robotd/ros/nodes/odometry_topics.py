"""Topics of a mobile base: wheel speeds, odometry and transform, from the control loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from tf2_msgs.msg import TFMessage

from robotd.device.process_image import ProcessImage
from robotd.robot import Robot
from robotd.ros.middleware import HotPublisher

DEPTH = 10
TF_TOPIC = "tf"
TF_DEPTH = 100

_POSE = ("position.x", "position.y", "orientation.z", "orientation.w")
_TRANSFORM = ("translation.x", "translation.y", "rotation.z", "rotation.w")
_TWIST = ("linear.x", "angular.z")


@dataclass(frozen=True)
class OdometryFrames:
    """Frames and covariances of the odometry.

    Attributes:
        odom, base: names of the fixed and of the moving frame.
        pose, twist: variances of x, y, z, roll, pitch, yaw, and of their rates, in SI units.
    """

    odom: str
    base: str
    pose: Sequence[float]
    twist: Sequence[float]


class OdometryTopics:
    """Made in any thread; ``publish`` belongs to the control loop.

    Nothing is published while the engine is not ready: old values must not look current.

    Args:
        omega_topic, odometry_topic: names.
        publish_tf: publish the transform odom → base, too.

    Attributes:
        topics: resolved names of all that is published.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        frames: OdometryFrames,
        omega_topic: str,
        odometry_topic: str,
        *,
        publish_tf: bool,
    ) -> None:
        if robot.base is None:
            raise ValueError(f"{robot.descriptor.name} has no base")
        self._base = robot.base
        self._connection = robot.connection
        self._clock = node.get_clock()
        self._axes = list(robot.wheel_axes)
        omega = node.create_publisher(Float64MultiArray, omega_topic, DEPTH)
        odometry = node.create_publisher(Odometry, odometry_topic, DEPTH)
        self.topics = [omega.topic_name, odometry.topic_name]
        self._omega = HotPublisher(omega, Float64MultiArray(data=[0.0, 0.0]), ["data"])
        pose = [f"pose.pose.{name}" for name in _POSE]
        twist = [f"twist.twist.{name}" for name in _TWIST]
        self._odometry = HotPublisher(odometry, _odometry(frames), [*pose, *twist])
        self._stamped = [self._odometry]
        self._poses = [[self._odometry.view(path) for path in pose]]
        self._twist = [self._odometry.view(path) for path in twist]
        self._wheels = self._omega.view("data")
        if publish_tf:
            publisher = node.create_publisher(TFMessage, TF_TOPIC, TF_DEPTH)
            self.topics.append(publisher.topic_name)
            paths = [f"transforms.0.transform.{name}" for name in _TRANSFORM]
            message = HotPublisher(publisher, _transform(frames), paths)
            self._stamped.append(message)
            self._poses.append([message.view(path) for path in paths])

    def publish(self, image: ProcessImage) -> None:
        if not self._connection.ready:
            return
        self._wheels[:] = image.velocity[self._axes]
        pose, twist = self._base.pose, self._base.twist(image)
        half = pose.heading / 2
        for views in self._poses:
            for view, value in zip(
                views, (pose.x, pose.y, math.sin(half), math.cos(half)), strict=True
            ):
                view[0] = value
        for view, value in zip(self._twist, twist, strict=True):
            view[0] = value
        now_ns = self._clock.now().nanoseconds
        for message in self._stamped:
            message.stamp(now_ns)
            message.publish()
        self._omega.publish()


def _odometry(frames: OdometryFrames) -> Odometry:
    message = Odometry(child_frame_id=frames.base)
    message.header.frame_id = frames.odom
    for part, variances in ((message.pose, frames.pose), (message.twist, frames.twist)):
        for index, variance in enumerate(variances):
            part.covariance[7 * index] = variance  # the diagonal of six rows and columns
    return message


def _transform(frames: OdometryFrames) -> TFMessage:
    transform = TransformStamped(child_frame_id=frames.base)
    transform.header.frame_id = frames.odom
    return TFMessage(transforms=[transform])
