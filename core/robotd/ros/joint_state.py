"""The joint topics: one set of numbers, published by the cycle in up to three shapes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from robotd.arrays import FloatArray
from robotd.device.gripper import Gripper
from robotd.device.image import ProcessImage
from robotd.robot import Robot
from robotd.ros.cdr import HotPublisher

DEPTH = 10


class Fingers:
    """Where the gripper's fingers are, told from its output bit. Cycle thread.

    Args:
        open_m, closed_m: position of every finger at the two ends.
    """

    def __init__(self, gripper: Gripper, open_m: float, closed_m: float) -> None:
        self._gripper = gripper
        self._open_m = open_m
        self._stroke_m = closed_m - open_m

    def position_m(self, time_ns: int) -> float:
        """Position of every finger at monotonic ``time_ns``."""
        return self._open_m + self._stroke_m * self._gripper.closed(time_ns)


class JointStateTopics:
    """Made in any thread; ``publish`` belongs to the cycle.

    Nothing is published while the engine is not ready: old values must not look alive.

    Attributes:
        topics: their resolved names.

    Args:
        names: of the arm's joints in the robot's order, then of the fingers.
        fingers: None where there is no gripper.
    """

    def __init__(
        self, node: Node, robot: Robot, names: Sequence[str], fingers: Fingers | None
    ) -> None:
        self.topics: list[str] = []
        self._node = node
        self._engine = robot.engine
        self._clock = node.get_clock()
        self._axes = np.array(robot.joint_axes, np.int64)
        self._joints = len(self._axes)
        self._names = list(names)
        self._fingers = fingers
        self._position = np.zeros(len(names))
        self._velocity = np.zeros(len(names))
        self._effort = np.full(len(names), np.nan)  # nothing measures the fingers' force
        self._stamped: list[HotPublisher] = []
        self._unstamped: list[HotPublisher] = []
        self._copies: list[tuple[FloatArray, FloatArray]] = []

    def add_joint_states(self, topic: str) -> None:
        """Stamped JointState; effort in N·m, NaN where it is not known."""
        self._stamped.append(self._joint_state(topic, effort=True))

    def add_unstamped(self, topic: str) -> None:
        """JointState with a zero stamp; no effort, since its reader takes it as a command."""
        self._unstamped.append(self._joint_state(topic, effort=False))

    def add_positions(self, topic: str) -> None:
        """Float64MultiArray of the positions, in the order of the names."""
        template = Float64MultiArray(data=self._position.tolist())
        message = HotPublisher(self._publisher(Float64MultiArray, topic), template, ["data"])
        self._copies.append((message.view("data"), self._position))
        self._unstamped.append(message)

    def publish(self, image: ProcessImage) -> None:
        if not self._engine.ready:
            return
        joints = self._joints
        self._position[:joints] = image.position[self._axes]
        self._velocity[:joints] = image.velocity[self._axes]
        self._effort[:joints] = image.torque[self._axes]
        if self._fingers is not None:
            self._position[joints:] = self._fingers.position_m(image.stamp_ns)
        for view, values in self._copies:
            view[:] = values
        now_ns = self._clock.now().nanoseconds
        for message in self._stamped:
            message.stamp(now_ns)
            message.publish()
        for message in self._unstamped:
            message.publish()

    def _joint_state(self, topic: str, *, effort: bool) -> HotPublisher:
        values = {"position": self._position, "velocity": self._velocity}
        if effort:
            values["effort"] = self._effort
        template = JointState(
            name=self._names, **{field: array.tolist() for field, array in values.items()}
        )
        message = HotPublisher(self._publisher(JointState, topic), template, values)
        self._copies += [(message.view(field), array) for field, array in values.items()]
        return message

    def _publisher(self, message_type: type, topic: str) -> Publisher:
        publisher = self._node.create_publisher(message_type, topic, DEPTH)
        self.topics.append(publisher.topic_name)
        return publisher
