"""Nodes of mobile bases: twists to wheels, and wheels to odometry."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from robotd.arrays import FloatArray
from robotd.control.groups.mobile_base import MobileBase
from robotd.descriptor import RobotDescriptor
from robotd.device.process_image import ProcessImage
from robotd.errors import DescriptorError, InvalidArgument
from robotd.motion.planar import Pose
from robotd.plugin.parameter_reader import ParameterReader
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.middleware import TypeMismatchCheck
from robotd_ros.nodes.base_settings import (
    BaseSettings,
    read_diff_drive,
    read_mecanum_drive,
    read_tricycle,
)
from robotd_ros.nodes.command_subscription import RejectionLog, add_command_subscription
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.nodes.latched_topics import publish_description
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.qos import STREAM
from robotd_ros.services import add_service, add_subscription

ECHO_DEPTH = 10
MAX_TILT = 1e-3  # of a quaternion about z

ReadSettings = Callable[[ParameterReader, RobotDescriptor], BaseSettings]
DEPTH = 10
TF_DEPTH = 100

_POSE = ("position.x", "position.y", "orientation.z", "orientation.w")
_TRANSFORM = ("translation.x", "translation.y", "rotation.z", "rotation.w")
_TWIST = ("linear.x", "angular.z", "linear.y")  # in the order of ``PlanarTwist``


class BaseController(Node):
    """Node of a mobile base: twists in, odometry out; ``MobileBase`` does the control.

    With this node in the set, the wheels are switched on at start.

    Args:
        read: declares the parameters of the node.
        robot: has a base.

    Raises:
        DescriptorError: the robot has no base of this kind, or a parameter is wrong; nothing was
            opened.
    """

    def __init__(self, name: str, read: ReadSettings, robot: Robot, host: RosHost) -> None:
        super().__init__(name, context=host.context)
        self._rejections = RejectionLog(host)
        settings = read_settings(self, robot.descriptor, read)
        if robot.base is None:
            raise DescriptorError(f"{name} needs a drive, which {robot.descriptor.name} has not")
        self._base = robot.base
        self._base.configure(settings.drive)
        if settings.parameters_file:
            robot.connection.parameters_file = settings.parameters_file
        self._take_commands(host, settings, robot)
        self._publish_state(settings, robot)
        publish_description(self, settings.description)
        add_service(self, host, Trigger, "~/reset_odometry", self._reset_odometry, blocking=False)
        self._odom_frame = settings.odom_frame
        add_subscription(self, host, PoseWithCovarianceStamped, "~/set_pose", self._set_pose, 1)

    def _take_commands(self, host: RosHost, settings: BaseSettings, robot: Robot) -> None:
        self._topic = settings.commands
        self._echo = None
        if settings.echo:
            self._echo = self.create_publisher(Twist, settings.echo, ECHO_DEPTH)
        taken = TwistStamped if settings.stamped else Twist
        self._is_stamped = settings.stamped
        subscription = add_command_subscription(
            self,
            host,
            robot,
            taken,
            self._topic,
            self._command,
            STREAM,
            self._base.settings.command_timeout_s,
        )
        if self._topic.startswith("~"):
            self._topic = subscription.topic_name  # for the log
        self._offered = TypeMismatchCheck(
            self,
            subscription,
            f"geometry_msgs/msg/{taken.__name__}",
            f"publish {taken.__name__}, or set use_stamped_vel to"
            f" {str(not settings.stamped).lower()}",
        )

    def _publish_state(self, settings: BaseSettings, robot: Robot) -> None:
        topics = OdometryTopics(self, robot, self._base, settings)
        robot.control_loop.every(settings.rate_hz, "odometry", topics.publish)
        self.rates_hz = dict.fromkeys(topics.topics, float(settings.rate_hz))

    def _command(self, message: Any, sent_ns: int) -> None:
        with self._rejections.noting(self._topic):
            twist = message.twist if self._is_stamped else message
            lateral = twist.linear.y if self._base.wheels.moves_sideways else 0.0
            x, z = twist.linear.x, twist.angular.z
            self._base.command(x, z, lateral, sent_ns=sent_ns, source=self._topic)
            if self._echo:
                self._echo.publish(twist)

    def _set_pose(self, message: Any) -> None:
        """Raise InvalidArgument for another frame, a tilted pose or one that is not finite."""
        frame, pose = message.header.frame_id, message.pose.pose
        if frame not in ("", self._odom_frame):
            raise InvalidArgument(f"the pose is in {frame!r}, not in {self._odom_frame!r}")
        q = pose.orientation
        if abs(q.x) + abs(q.y) > MAX_TILT or q.z**2 + q.w**2 < 1.0 - MAX_TILT:
            raise InvalidArgument(
                f"orientation ({q.x:g}, {q.y:g}, {q.z:g}, {q.w:g}) is not one about z"
            )
        heading = math.remainder(2.0 * math.atan2(q.z, q.w), math.tau)
        self._base.reset_odometry(Pose(pose.position.x, pose.position.y, heading))

    def _reset_odometry(self, request: Any, response: Any) -> str:
        self._base.reset_odometry()
        return "odometry set to zero"


DiffDriveController = partial(BaseController, "diff_drive_controller", read_diff_drive)
MecanumDriveController = partial(BaseController, "mecanum_drive_controller", read_mecanum_drive)
TricycleController = partial(BaseController, "tricycle_controller", read_tricycle)


class OdometryTopics(HotTopics):
    """Odometry, its transform, the limited command and the speeds of the wheels."""

    def __init__(self, node: Node, robot: Robot, base: MobileBase, settings: BaseSettings) -> None:
        super().__init__(node, robot)
        self._base = base
        self._axes = list(base.settings.axes)
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
