"""robot_state_publisher: transforms of the whole robot from its URDF."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from robotd.arrays import FloatArray
from robotd.descriptor.urdf import JointFrames, UrdfJoint, parse_urdf
from robotd.device.process_image import ProcessImage
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.base_controller import TF_DEPTH
from robotd_ros.nodes.base_settings import TF_TOPIC
from robotd_ros.nodes.device_settings import read_state_publisher
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.nodes.latched_topics import publish_description
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.nodes.tool_pose_topic import fill_transform
from robotd_ros.qos import LATCHED

NAME = "robot_state_publisher"
STATIC_TOPIC = "tf_static"

log = get_logger("ros")


class RobotStatePublisher(Node):
    """Node that publishes moving frames from the control loop, and fixed ones latched.

    It reads the joints from the process image, not from ``joint_states``.

    Raises DescriptorError: a parameter or the URDF is wrong; nothing was opened.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        settings = read_settings(self, robot.descriptor, read_state_publisher)
        path = robot.descriptor.urdf or Path("robot_description")
        urdf = parse_urdf(settings.description, path)
        known = _KnownJoints(robot)
        frames = JointFrames(urdf, known.names)
        if idle := [joint.name for joint in frames.still if joint.moves]:
            log.info("joints that nothing moves are published at 0", joints=idle)
        publish_description(self, settings.description)
        static = self.create_publisher(TFMessage, STATIC_TOPIC, LATCHED)
        static.publish(self._static(frames, settings.prefix))
        self.rates_hz: dict[str, float] = {}
        if frames.moving:
            moving = _MovingTopic(self, robot, frames, known, settings.prefix)
            robot.control_loop.every(settings.rate_hz, "transforms", moving.publish)
            self.rates_hz = dict.fromkeys(moving.topics, settings.rate_hz)

    def _static(self, frames: JointFrames, prefix: str) -> TFMessage:
        message = TFMessage(transforms=_templates(frames.still, prefix))
        stamp = self.get_clock().now().to_msg()
        for transform, numbers in zip(message.transforms, frames.still_transforms(), strict=True):
            transform.header.stamp = stamp
            fill_transform(transform, numbers)
        return message


class _KnownJoints:
    """Positions of arm joints, wheels and fingers. Control loop.

    Attributes:
        names: of the joints, in the order of ``positions``.
    """

    def __init__(self, robot: Robot) -> None:
        drive = robot.descriptor.drive
        self._axes = list(robot.joint_axes)
        self.names = list(robot.joint_names)
        if drive is not None and drive.wheel_joints:
            self._axes += drive.axes
            self.names += drive.wheel_joints
        self._gripper = robot.gripper
        if self._gripper is not None:
            self.names += self._gripper.joints

    def positions(self, image: ProcessImage) -> FloatArray:
        """Return rad or m, shape (names,); NaN where the device does not know a position."""
        measured = image.position[self._axes]
        if self._gripper is None:
            return measured
        fingers = self._gripper.finger_positions
        return np.concatenate([measured, fingers])


class _MovingTopic(HotTopics):
    """Transforms of moving joints, while all positions are known."""

    def __init__(
        self,
        node: Node,
        robot: Robot,
        frames: JointFrames,
        known: _KnownJoints,
        prefix: str,
    ) -> None:
        super().__init__(node, robot)
        self._frames, self._known = frames, known
        template = TFMessage(transforms=_templates(frames.moving, prefix))
        paths = [f"transforms.{index}.transform" for index in range(len(frames.moving))]
        message = self.add(TF_TOPIC, TF_DEPTH, template, paths)
        self._views = [message.view(path) for path in paths]

    def fill(self, image: ProcessImage) -> bool:
        positions = self._known.positions(image)
        if not np.isfinite(positions).all():
            return False
        for view, numbers in zip(self._views, self._frames.transforms(positions), strict=True):
            view[:] = numbers
        return True


def _templates(joints: Iterable[UrdfJoint], prefix: str) -> Sequence[TransformStamped]:
    messages = []
    for joint in joints:
        message = TransformStamped(child_frame_id=prefix + joint.child)
        message.header.frame_id = prefix + joint.parent
        messages.append(message)
    return messages
