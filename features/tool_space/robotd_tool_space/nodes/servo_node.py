"""servo_node: twists and poses of the tool on topics, as MoveIt Servo takes them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from std_msgs.msg import Int8, String

from robotd.api import FloatArray, InvalidArgument, RobotdError, unknown_name
from robotd.api.robots import Robot
from robotd_ros.api import STREAM, RosHost, TopicStream, add_command_subscription, read_settings
from robotd_tool_space.geometry.rotations import pose_of_message
from robotd_tool_space.nodes.node_settings import ServoSettings, ServoTopics, read_servo
from robotd_tool_space.streams.servo_status import ServoStatus
from robotd_tool_space.streams.twist import Command, PoseCommand, ToolTwist, TwistStage
from robotd_tool_space.tool_groups import ToolGroups

NAME = "servo_node"
STATUS_HZ = 20.0


class ServoNode(Node):
    """Topics of MoveIt Servo: the tool moves while messages come.

    Raises:
        DescriptorError: a parameter is wrong, or the URDF has no chain to the tool.
        Unsupported: the robot has no URDF.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        settings = read_settings(self, robot.descriptor, read_servo)
        servos = [
            _GroupServo(self, robot, host, group, topics, settings)
            for group, topics in settings.topics.items()
        ]
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # no clock jump stops it

        def publish() -> None:
            for servo in servos:
                servo.publish()

        self._timer = self.create_timer(1.0 / STATUS_HZ, publish, clock=steady)


class _GroupServo:
    """Topics of one joint group. Executor thread."""

    def __init__(
        self,
        node: Node,
        robot: Robot,
        host: RosHost,
        group: str,
        topics: ServoTopics,
        settings: ServoSettings,
    ) -> None:
        joints = robot.groups[group]
        self._tool = robot.feature(ToolGroups).of(group)
        _ = self._tool.kinematics.task  # takes a while: not in the control loop
        self._stage = TwistStage(
            lambda: self._tool.kinematics, joints.motion_limits, settings.limits
        )
        twist_topic = node.resolve_topic_name(topics.twist).lstrip("/")
        client = joints.stream.client(NAME, settings.timeout_s, twist_topic)
        self._stream = TopicStream(client, host, twist_topic)
        self._status = node.create_publisher(Int8, topics.status, 1)
        self._message = node.create_publisher(String, topics.message, 1)
        for message_type, topic, read in (
            (TwistStamped, topics.twist, self._twist),
            (PoseStamped, topics.pose, self._pose),
        ):
            on_message = partial(self._stream.apply, partial(self._command, read))
            add_command_subscription(
                node, host, robot, message_type, topic, on_message, STREAM, settings.timeout_s
            )

    def publish(self) -> None:
        """Publish the status."""
        status = self._stage.status if self._stream.is_open else ServoStatus()
        if (followed := self._tool.followed) is not None and followed.failure:
            status = status._replace(text=followed.failure)
        self._status.publish(Int8(data=int(status.code)))
        self._message.publish(String(data=status.text))

    def _command(
        self, read: Callable[[Any], Command], commands: Any, message: Any, sent_ns: int
    ) -> Any:
        try:
            command = read(message)
        except RobotdError:
            commands.source.admit(moves=True)  # no silence: it would move once its frame is chosen
            raise
        return commands.reference(self._stage, command, moves=command.moves, sent_ns=sent_ns)

    def _twist(self, message: TwistStamped) -> ToolTwist:
        linear, angular = message.twist.linear, message.twist.angular
        numbers = (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
        twist: FloatArray = np.array(numbers, np.float64)
        if not np.isfinite(twist).all():
            raise InvalidArgument(f"twist {list(numbers)} has a number that is not finite")
        frame = message.header.frame_id
        if self._is_work_frame(frame):
            return self._tool.twist_in_work_frame(twist)
        return ToolTwist(twist, self._is_tool(frame))

    def _pose(self, message: PoseStamped) -> PoseCommand:
        pose = pose_of_message(message.pose)
        frame = message.header.frame_id
        if self._is_work_frame(frame):
            return self._tool.target_in_work_frame(pose)
        if self._is_tool(frame):
            raise InvalidArgument(f"frame_id {frame}: a pose is one in {self._tool.base}")
        return PoseCommand(pose)

    def _is_work_frame(self, frame: str) -> bool:
        return bool(frame) and frame == self._tool.work_frame_name

    def _is_tool(self, frame: str) -> bool:
        """Return True for the tool in force; "" is the base.

        The link that the tools are fixed to stands for it: clients of MoveIt Servo know no tools.
        """
        tool = self._tool
        base, *names = filter(None, (tool.base, tool.link, tool.tool_name))
        if frame and frame not in (base, *names):
            known = filter(None, (base, *names, tool.work_frame_name))
            raise InvalidArgument(unknown_name("frame_id", frame, known))
        return frame in names
