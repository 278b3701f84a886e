"""joint_command_node: motion of an arm that its clients decide while it moves, on topics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from control_msgs.msg import JointJog
from control_msgs.srv import QueryTrajectoryState
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from robotd.control.joint_group import JointGroup
from robotd.control.joint_motion import OWNER
from robotd.control.joint_stream import JointCommands
from robotd.control.open_stream import StreamClient
from robotd.control.stream_setpoints import StreamCommand
from robotd.control.torque_stream import TorqueCommand, TorqueCommands
from robotd.errors import DescriptorError, InvalidArgument, unknown_name
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.command_settings import JointTopics, read_joint_command
from robotd_ros.nodes.command_subscription import add_command_subscription
from robotd_ros.nodes.controller_state_topic import ControllerStateTopic, TrajectoryQuery
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.nodes.topic_stream import TopicStream
from robotd_ros.nodes.trajectory_topic import TrajectoryTopic
from robotd_ros.qos import STREAM
from robotd_ros.services import add_service

NAME = "joint_command_node"


class JointCommandNode(Node):
    """Topics of joint_trajectory_controller, the forward controllers and MoveIt Servo's joint jog.

    Each topic moves the joints while messages come. One client at a time: see ``stream.takeover``.

    Raises:
        DescriptorError: the robot has no joints, or a parameter is wrong.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        if not robot.joint_names:
            raise DescriptorError(f"{NAME} needs joints, which {robot.descriptor.name} has not")
        self._robot, self._host = robot, host
        settings = read_settings(self, robot.descriptor, read_joint_command)
        self._timeout_s, self._state_rate_hz = settings.timeout_s, settings.state_rate_hz
        self.rates_hz: dict[str, float] = {}
        for name, topics in settings.topics.items():
            self._serve(robot.groups[name], topics)

    def _serve(self, group: JointGroup, topics: JointTopics) -> None:
        """Offer the topics and the service of one joint group."""
        robot, host = self._robot, self._host
        if topics.trajectory:
            client = group.stream.client(OWNER, self._timeout_s, topics.trajectory)
            stream = TopicStream(client, host, topics.trajectory)
            TrajectoryTopic(self, robot, group, host, topics.trajectory, stream, self._timeout_s)
        command: Callable[..., Any]
        for topic, message_type, streams, command in (
            (topics.position, Float64MultiArray, group.stream, _positions),
            (topics.velocity, Float64MultiArray, group.stream, _velocities),
            (topics.jog, JointJog, group.stream, _jog),
            (topics.effort, Float64MultiArray, group.torque_stream, _efforts),
        ):
            if topic:
                opened: StreamClient[Any] = streams.client(topic, self._timeout_s)
                apply = partial(TopicStream(opened, host, topic).apply, command)
                add_command_subscription(
                    self, host, robot, message_type, topic, apply, STREAM, self._timeout_s
                )
        if topics.state:
            publisher = ControllerStateTopic(self, robot, group, topics.state)
            robot.control_loop.every(self._state_rate_hz, "controller state", publisher.publish)
            self.rates_hz |= dict.fromkeys(publisher.topics, float(self._state_rate_hz))
        if topics.query:
            answer = TrajectoryQuery(self, group, robot.clock).answer
            add_service(self, host, QueryTrajectoryState, topics.query, answer, blocking=False)


def joint_values(
    known: Sequence[str], names: Sequence[str], values: Sequence[float]
) -> list[float]:
    """Return one value for each of ``known``, 0 for joints without one.

    Raises InvalidArgument for an unknown joint, one that is given twice, or a wrong number.
    """
    if len(values) != len(names):
        raise InvalidArgument(f"{len(values)} values for {len(names)} joints")
    for name in names:
        if name not in known:
            raise InvalidArgument(unknown_name("joint", name, known))
    given = dict(zip(names, values, strict=True))
    if len(given) < len(names):
        raise InvalidArgument(f"a joint is given twice: {', '.join(names)}")
    return [given.get(name, 0.0) for name in known]


def _positions(commands: JointCommands, message: Any, sent_ns: int) -> StreamCommand:
    return commands.position(message.data, sent_ns=sent_ns)


def _efforts(commands: TorqueCommands, message: Any, sent_ns: int) -> TorqueCommand:
    return commands.torque(message.data, sent_ns=sent_ns)


def _velocities(commands: JointCommands, message: Any, sent_ns: int) -> StreamCommand:
    return commands.velocity(message.data, sent_ns)


def _jog(commands: JointCommands, message: Any, sent_ns: int) -> StreamCommand:
    if len(message.displacements):
        raise InvalidArgument("displacements are not supported; send velocities")
    velocity = joint_values(commands.joints, message.joint_names, message.velocities)
    return commands.velocity(velocity, sent_ns)
