"""Topics of a mobile base, from the control loop: odometry, wheel speeds, limited command."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import TransformStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from tf2_msgs.msg import TFMessage

from robotd.arrays import FloatArray
from robotd.control.mobile_base import MobileBase
from robotd.device.process_image import ProcessImage
from robotd.robot import Robot
from robotd_ros.nodes.base_settings import BaseSettings
from robotd_ros.nodes.hot_topics import HotTopics

DEPTH = 10
TF_DEPTH = 100

_POSE = ("position.x", "position.y", "orientation.z", "orientation.w")
_TRANSFORM = ("translation.x", "translation.y", "rotation.z", "rotation.w")
_TWIST = ("linear.x", "angular.z", "linear.y")  # in the order of ``PlanarTwist``


class OdometryTopics(HotTopics):
    """Odometry, its transform, the limited command and the speeds of the wheels."""

    def __init__(self, node: Node, robot: Robot, base: MobileBase, settings: BaseSettings) -> None:
        super().__init__(node, robot)
        self._base = base
        self._axes = list(robot.wheel_axes)
        paths = [f"pose.pose.{name}" for name in _POSE] + [f"twist.twist.{name}" for name in _TWIST]
        views = self._add(settings.odometry, DEPTH, _odometry(settings), paths)
        self._poses, self._twists = [views[: len(_POSE)]], [views[len(_POSE) :]]
        if settings.transform:
            paths = [f"transforms.0.transform.{name}" for name in _TRANSFORM]
            self._poses.append(self._add(settings.transform, TF_DEPTH, _transform(settings), paths))
        if settings.limited:
            paths = [f"twist.{name}" for name in _TWIST]
            self._twists.append(self._add(settings.limited, DEPTH, _limited(settings), paths))
        speeds = Float64MultiArray(data=[0.0] * len(self._axes))
        message = self.add(settings.wheel_speeds, DEPTH, speeds, ["data"], stamped=False)
        self._wheels = message.view("data")

    def _add(self, topic: str, depth: int, template: Any, paths: Sequence[str]) -> list[FloatArray]:
        """Add a topic; return the views of the message's values at ``paths``."""
        message = self.add(topic, depth, template, paths)
        return [message.view(path) for path in paths]

    def fill(self, image: ProcessImage) -> bool:
        self._wheels[:] = image.velocity[self._axes]
        pose = self._base.pose
        half = pose.heading / 2
        for views in self._poses:
            for view, value in zip(
                views, (pose.x, pose.y, math.sin(half), math.cos(half)), strict=True
            ):
                view[0] = value
        twists = self._base.twist(image), self._base.limited
        for views, twist in zip(self._twists, twists, strict=False):
            for view, value in zip(views, twist, strict=True):
                view[0] = value
        return True


def _odometry(settings: BaseSettings) -> Odometry:
    message = Odometry(child_frame_id=settings.base_frame)
    message.header.frame_id = settings.odom_frame
    parts = (message.pose, settings.pose_variances), (message.twist, settings.twist_variances)
    for part, variances in parts:
        for index, variance in enumerate(variances):
            part.covariance[7 * index] = variance  # the diagonal of six rows and columns
    return message


def _transform(settings: BaseSettings) -> TFMessage:
    transform = TransformStamped(child_frame_id=settings.base_frame)
    transform.header.frame_id = settings.odom_frame
    return TFMessage(transforms=[transform])


def _limited(settings: BaseSettings) -> TwistStamped:
    message = TwistStamped()
    message.header.frame_id = settings.base_frame
    return message
