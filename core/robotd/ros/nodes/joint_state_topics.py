"""Joint topics, published by the control loop in up to three message types."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from robotd.arrays import FloatArray
from robotd.device.gripper import Gripper
from robotd.device.process_image import ProcessImage, columns
from robotd.robot import Robot
from robotd.ros.middleware import HotPublisher, Link, StampClock

DEPTH = 10


class Fingers:
    """Position of the gripper's fingers, from its output bit. Control loop thread.

    Args:
        open_m, closed_m: position of the gripper at the two ends.
        multipliers: position of each finger per position of the gripper; shape (fingers,).
    """

    def __init__(
        self, gripper: Gripper, open_m: float, closed_m: float, multipliers: FloatArray
    ) -> None:
        self.multipliers = multipliers
        self._gripper = gripper
        self._open_m = open_m
        self._stroke_m = closed_m - open_m

    def position_m(self, time_ns: int) -> float:
        """Position of the gripper at monotonic ``time_ns``."""
        return self._open_m + self._stroke_m * self._gripper.closed(time_ns)


class _JointTopic:
    """One topic and the copies that fill its message. Control loop thread."""

    def __init__(self, message: HotPublisher, links: Sequence[Link], *, stamped: bool) -> None:
        self.message, self.stamped = message, stamped
        self._links = links

    def publish(self, stamp_ns: int) -> None:
        for copy in self._links:
            copy()
        if self.stamped:
            self.message.stamp(stamp_ns)
        self.message.publish()


class JointStateTopics:
    """Made in any thread; ``publish`` belongs to the control loop.

    Nothing is published without subscribers, nor while the engine is not ready: old values
    must not look current.

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
        self._connection, self._control_loop = robot.connection, robot.control_loop
        self._slow = robot.axes.feedback_period_s > 0.0  # stamps are those of the values
        self._clock = StampClock(node.get_clock())
        self._joints = len(robot.joint_axes)
        self._names = list(names)
        self._fingers = fingers
        self._finger_m = 0.0
        self._all: list[_JointTopic] = []
        self._positions: list[FloatArray] = []  # of each message
        self._index = columns(robot.joint_axes)
        self._measured: FloatArray = robot.image.measured[:, self._index]
        self._is_gathered = not isinstance(self._index, slice)  # the axes are not side by side
        if self._is_gathered:
            self._measured = np.ascontiguousarray(self._measured)

    def add_joint_states(self, topic: str) -> None:
        """Stamped JointState; effort in N·m, NaN where it is not known."""
        self._add_joint_state(topic, ("position", "velocity", "effort"), stamped=True)

    def add_unstamped(self, topic: str) -> None:
        """JointState with a zero stamp; no effort, since its reader takes it as a command."""
        self._add_joint_state(topic, ("position", "velocity"), stamped=False)

    def add_positions(self, topic: str) -> None:
        """Float64MultiArray of the positions, in the order of the names."""
        template = Float64MultiArray(data=[0.0] * len(self._names))
        self._add(topic, template, ("data",), stamped=False)

    def publish(self, image: ProcessImage) -> None:
        """Publish the image of the present period, stamped with the start of the period."""
        if not self._connection.ready:
            return
        wanted = [topic for topic in self._all if topic.message.has_readers]
        if not wanted:
            return
        if self._is_gathered:
            self._measured[:] = image.measured[:, self._index]
        self._move_fingers(image.stamp_ns)
        stamp_ns = self._clock.at_ns(self._control_loop.started_ns)
        if self._slow:
            stamp_ns -= max(0, image.stamp_ns - image.fresh_ns)
        for topic in wanted:
            topic.publish(stamp_ns)

    def _move_fingers(self, time_ns: int) -> None:
        fingers = self._fingers
        if fingers is None or (position_m := fingers.position_m(time_ns)) == self._finger_m:
            return
        self._finger_m = position_m
        for positions in self._positions:
            np.multiply(fingers.multipliers, position_m, positions[self._joints :])

    def _add_joint_state(self, topic: str, fields: tuple[str, ...], *, stamped: bool) -> None:
        rest = [0.0] * len(self._names)
        template = JointState(name=self._names, position=rest, velocity=rest)
        if "effort" in fields:
            template.effort = [math.nan] * len(rest)  # nothing measures the fingers' force
        self._add(topic, template, fields, stamped=stamped)

    def _add(self, topic: str, template: Any, fields: tuple[str, ...], *, stamped: bool) -> None:
        """``fields`` are the first of position, velocity and effort."""
        message = HotPublisher(self._node, topic, DEPTH, template, fields)
        self.topics.append(message.topic)
        self._positions.append(message.view(fields[0]))
        links = [
            Link(message.view(field), values)
            for field, values in zip(fields, self._measured, strict=False)
        ]
        self._all.append(_JointTopic(message, links, stamped=stamped))
