"""Topic of joint_trajectory_controller: whole trajectories, and single points as a stream."""

from __future__ import annotations

import math
import threading
from typing import Any

from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from robotd.clock import NANOSECONDS
from robotd.control.joint_group import JointGroup
from robotd.control.joint_stream import JointStream
from robotd.control.open_stream import chosen_columns
from robotd.control.rearming import Admission
from robotd.control.trajectory_execution import TrajectoryExecution
from robotd.errors import InvalidArgument, NotReady, RobotdError
from robotd.log import get_logger
from robotd.motion.rejection import reject
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.command_subscription import add_command_subscription, header_stamp_ns
from robotd.ros.nodes.rejection_log import RejectionLog
from robotd.ros.nodes.topic_stream import TopicStream
from robotd.ros.nodes.trajectory_conversions import (
    duration_s,
    start_time_ns,
    trajectory_request,
)

log = get_logger("trajectory")

DEPTH = 10
STREAM_S = 0.25  # a single point at most that far ahead is a streamed one
TIMEOUT_S = 1.0  # age at which a trajectory is dropped; a long one takes a while on a slow network
MAX_AHEAD_S = 60.0  # start of a trajectory; its stamp may be of another clock


class TrajectoryTopic:
    """Executes each trajectory of a topic in place of the running one.

    - Several points, or one that is further ahead than ``STREAM_S``: as a goal of the action,
      without a result.
    - One point without or with a short time, as MoveIt Servo sends them: a target of a stream.
    - No point: the motion that this topic has started comes to rest.

    Args:
        node: subscribes.
        robot: of the group.
        group: executes.
        host: its workers execute trajectories.
        topic: name.
        stream: of single points.
        timeout_s: age at which a single point is dropped.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        group: JointGroup,
        host: RosHost,
        topic: str,
        stream: TopicStream[JointStream],
        timeout_s: float,
    ) -> None:
        self._group, self._clock, self._ros_clock = group, robot.clock, node.get_clock()
        self._host, self._topic, self._stream = host, topic, stream
        self._source = group.follower.source(topic, robot.rearming)
        self._rejections = RejectionLog()
        self._lock = threading.Lock()
        self._execution: TrajectoryExecution | None = None  # of the ticket that follows
        self._newest = 0
        self._stopped = 0  # ticket of the last message without points
        add_command_subscription(
            node,
            host,
            robot,
            JointTrajectory,
            topic,
            self._take,
            DEPTH,
            lambda message: _timeout_s(message, timeout_s),
            lambda message: header_stamp_ns(message) if _is_streamed(message) else 0,
        )

    def _take(self, message: Any, sent_ns: int) -> None:
        points = message.points
        if not points:
            self._stream.stop()
            self._source.admit(moves=False)
            with self._lock:
                self._stopped = self._group.motion.ticket()
                if self._execution is not None:
                    self._execution.cancel()
        elif _is_streamed(message):
            self._stream.apply(lambda stream: self._send(message, stream, sent_ns))
        else:
            self._execute(message)

    def _send(self, message: Any, stream: JointStream, sent_ns: int) -> None:
        """Send the only point of ``message``; joints that it does not name hold."""
        point = message.points[0]
        columns = chosen_columns(message.joint_names or None, stream.joints).tolist()
        if len(point.positions) != len(columns):
            raise InvalidArgument(
                f"{len(point.positions)} positions for {len(columns)} joints; a streamed point"
                " needs positions"
            )
        if len(point.velocities) not in (0, len(columns)):
            raise InvalidArgument(f"{len(point.velocities)} velocities for {len(columns)} joints")
        position = self._group.motion.command().tolist()
        velocity = [0.0] * len(position)
        for index, column in enumerate(columns):
            position[column] = point.positions[index]
            if len(point.velocities):
                velocity[column] = point.velocities[index]
        if point.effort:
            raise InvalidArgument("effort in the point is not supported; leave it empty")
        stream.send(position, velocity if any(velocity) else None, sent_ns=sent_ns)

    def _execute(self, message: Any) -> None:
        """Let a worker execute a trajectory; a rejection is logged."""
        try:
            admission = self._source.admit(moves=True)
            self._host.submit(self._follow, message, self._group.motion.ticket(), admission)
        except RobotdError as error:
            self._rejections.rejected(self._topic, (), str(error))

    def _follow(self, message: Any, ticket: int, admission: Admission) -> None:
        """Worker: execute a trajectory until it has ended; one that was stopped before ends."""
        with self._rejections.noting(self._topic):
            if not admission.holds:
                raise NotReady("motion was rejected before the trajectory could begin")
            request = trajectory_request(message)
            start_ns = start_time_ns(message, self._ros_clock, self._clock)
            if start_ns is not None and start_ns - self._clock.now_ns() > MAX_AHEAD_S * NANOSECONDS:
                ahead_s = (start_ns - self._clock.now_ns()) / NANOSECONDS
                raise reject(
                    f"header.stamp is {ahead_s:.3g} s ahead, at most {MAX_AHEAD_S:g} s are allowed"
                )
            with self._group.follower.follow(request, None, start_ns, ticket) as execution:
                with self._lock:
                    if self._newest < ticket:
                        self._newest, self._execution = ticket, execution
                    if ticket < self._stopped:
                        execution.cancel()
                execution.wait()
            log.info("trajectory ended", topic=self._topic, reason=execution.message)


def _timeout_s(message: Any, stream_s: float) -> float:
    """Return the age at which a message is dropped: never where it stops the joints."""
    if not message.points:
        return math.inf
    return stream_s if _is_streamed(message) else TIMEOUT_S


def _is_streamed(message: Any) -> bool:
    """Return True for one point with a short time: a target of the stream."""
    points = message.points
    return len(points) == 1 and duration_s(points[0].time_from_start) <= STREAM_S
