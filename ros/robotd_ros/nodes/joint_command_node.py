"""joint_command_node: motion of an arm that its clients decide while it moves, on topics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from control_msgs.msg import JointJog, JointTrajectoryControllerState
from control_msgs.srv import QueryTrajectoryState
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectoryPoint

from robotd.clock import Clock
from robotd.control.groups.joint_group import JointGroup
from robotd.control.groups.joint_motion import OWNER
from robotd.control.groups.joint_stream import JointCommands
from robotd.control.groups.streams import StreamClient
from robotd.control.groups.torque_stream import TorqueCommand, TorqueCommands
from robotd.control.sources.stream_source import StreamCommand
from robotd.device.process_image import ProcessImage, columns
from robotd.errors import DescriptorError, InvalidArgument, unknown_name
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.arm_settings import JointTopics, read_joint_command
from robotd_ros.nodes.command_subscription import add_command_subscription
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.nodes.topic_stream import TopicStream
from robotd_ros.nodes.trajectory_conversions import clock_time_ns, stamp_ns
from robotd_ros.nodes.trajectory_topic import TrajectoryTopic
from robotd_ros.qos import STREAM
from robotd_ros.services import add_service

NAME = "joint_command_node"
DEPTH = 10
SPEED = "speed_scaling_factor"
POINTS = ("reference", "output", "feedback", "error")


class JointCommandNode(Node):
    """Topics of joint_trajectory_controller, the forward controllers and MoveIt Servo's joint jog.

    Each topic moves the joints while messages come. One client at a time: see ``stream.takeover``.

    Raises DescriptorError: the robot has no joints, or a parameter is wrong.
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


class ControllerStateTopic(HotTopics):
    """Commanded and measured motion of a joint group."""

    def __init__(self, node: Node, robot: Robot, group: JointGroup, topic: str) -> None:
        super().__init__(node, robot)
        rest = [0.0] * len(group.joint_names)
        template = JointTrajectoryControllerState(joint_names=list(group.joint_names))
        for name in POINTS:
            setattr(template, name, JointTrajectoryPoint(positions=rest, velocities=rest))
        paths = [f"{name}.{field}" for name in POINTS for field in ("positions", "velocities")]
        message = self.add(topic, DEPTH, template, [*paths, SPEED])
        self._views = {path: message.view(path) for path in paths}
        self._speed, self._follower = message.view(SPEED), group.follower
        self._columns = columns(group.joint_axes)

    def fill(self, image: ProcessImage) -> bool:
        commanded, measured = image.commands[:, self._columns], image.measured[:2, self._columns]
        for row, field in enumerate(("positions", "velocities")):
            self._views[f"reference.{field}"][:] = commanded[row]
            self._views[f"output.{field}"][:] = commanded[row]
            self._views[f"feedback.{field}"][:] = measured[row]
            self._views[f"error.{field}"][:] = commanded[row] - measured[row]
        self._speed[:] = self._follower.rate
        return True


class TrajectoryQuery:
    """Answers a query with the running trajectory at a ROS time, or the held position."""

    def __init__(self, node: Node, group: JointGroup, clock: Clock) -> None:
        self._group, self._clock, self._ros_clock = group, clock, node.get_clock()

    def answer(self, request: Any, response: Any) -> None:
        """Fill the response of a ``QueryTrajectoryState``; time zero means now."""
        asked_ns = stamp_ns(request.time)
        now_ns = self._clock.now_ns()
        time_ns = clock_time_ns(asked_ns, self._ros_clock, self._clock) if asked_ns else now_ns
        state = self._group.follower.state_at(time_ns)
        if state is None or not np.isfinite(state.position).all():
            response.message = "no trajectory runs: the motion is decided by a stream, or unknown"
            return
        response.success = True
        response.name = list(self._group.joint_names)
        response.position = state.position.tolist()
        response.velocity = state.velocity.tolist()
        response.acceleration = state.acceleration.tolist()
