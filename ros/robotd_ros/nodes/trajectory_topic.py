"""Topic of joint_trajectory_controller: whole trajectories, and single points as a stream."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from robotd.clock import NANOSECONDS
from robotd.control.groups.joint_group import JointGroup
from robotd.control.groups.joint_stream import JointCommands, JointStream
from robotd.control.groups.streams import chosen_columns
from robotd.control.loop.rearming import Admission
from robotd.control.sources.stream_source import StreamCommand
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.errors import InvalidArgument, NotReady, RobotdError
from robotd.log import get_logger
from robotd.motion.rejection import reject
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.command_subscription import (
    RejectionLog,
    add_command_subscription,
    header_stamp_ns,
)
from robotd_ros.nodes.topic_stream import TopicStream
from robotd_ros.nodes.trajectory_conversions import stamp_ns, start_time_ns, trajectory_request

log = get_logger("trajectory")

DEPTH = 10
HANDLER_SHARE = 0.4  # a message of 50 points takes 1 ms, and MoveIt Servo sends up to 250 a second
STREAM_S = 0.25  # points at most that far ahead are streamed
# Age at which a trajectory is dropped, and wait for a worker; a long one takes a while on a slow
# network.
TIMEOUT_S = 1.0
MAX_AHEAD_S = 60.0  # start of a trajectory; its stamp may be of another clock


class TrajectoryTopic:
    """Executes each trajectory of a topic in place of the running one.

    - Points that end further ahead than ``STREAM_S``: as a goal of the action, without a result.
    - One point with a short time, as MoveIt Servo of Humble sends it: a target of a stream.
    - Several in a short time, as it does since Jazzy: points of one motion, each message replaces
      the rest of the one before.
    - No point: the motion that this topic has started comes to rest.

    Args:
        host: its workers execute trajectories.
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
        self._timeout_s = timeout_s
        self._source = group.follower.source(topic, robot.rearming)
        self._rejections = RejectionLog(host)
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
            self._timeout,
            self._judged_ns,
            share=HANDLER_SHARE,
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
        elif self._is_streamed(message):
            self._stream.apply(self._command, message, sent_ns)
        else:
            self._execute(message)

    def _command(self, commands: JointCommands, message: Any, sent_ns: int) -> StreamCommand:
        """Return the command of the points of ``message``; joints that it does not name hold."""
        points = message.points
        columns = chosen_columns(message.joint_names or None, commands.joints).tolist()
        if any(point.effort for point in points):
            raise InvalidArgument("effort in the point is not supported; leave it empty")
        moves = len(points[0].velocities) > 0
        for point in points:
            if len(point.positions) != len(columns):
                raise InvalidArgument(
                    f"{len(point.positions)} positions for {len(columns)} joints; a streamed point"
                    " needs positions"
                )
            if len(point.velocities) != len(columns) * moves:
                raise InvalidArgument(
                    f"{len(point.velocities)} velocities for {len(columns)} joints"
                )
        position = np.tile(self._group.motion.command(), (len(points), 1))
        position[:, columns] = [point.positions for point in points]
        velocity = np.zeros_like(position)
        if moves:
            velocity[:, columns] = [point.velocities for point in points]
        if len(points) == 1:
            target = velocity[0].tolist() if velocity.any() else None
            return commands.position(position[0].tolist(), target, sent_ns=sent_ns)
        begin_ns = start_time_ns(message, self._ros_clock, self._clock) or sent_ns
        times_ns = [begin_ns + stamp_ns(point.time_from_start) for point in points]
        speeds = velocity if moves else None
        return commands.points(times_ns, position, speeds, sent_ns=sent_ns)

    def _execute(self, message: Any) -> None:
        """Let a worker execute a trajectory; a rejection is logged."""
        try:
            admission = self._source.admit(moves=True)
            ticket = self._group.motion.ticket()
            call = message, ticket, admission, time.monotonic()
            self._host.submit(self._follow, *call, until_rest=True)
        except RobotdError as error:
            self._rejections.rejected(self._topic, (), str(error))

    def _follow(self, message: Any, ticket: int, admission: Admission, arrived_s: float) -> None:
        """Worker: execute a trajectory until it has ended; one that was stopped before ends."""
        with self._rejections.noting(self._topic):
            waited_s = time.monotonic() - arrived_s
            if waited_s > TIMEOUT_S:
                raise NotReady(
                    f"the trajectory has waited {waited_s:.3g} s for a worker: after"
                    f" {TIMEOUT_S:g} s it is dropped"
                )
            if ticket < self._stopped:
                raise NotReady("the trajectory was stopped before it could begin")
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

    def _timeout(self, message: Any) -> float:
        """Return the age at which a message is dropped: never where it stops the joints."""
        if not message.points:
            return math.inf
        return self._timeout_s if self._is_streamed(message) else TIMEOUT_S

    def _judged_ns(self, message: Any) -> int:
        """Return the time in a message from which its age counts; 0: it has none.

        The stamp of a trajectory is its beginning, which may be past or to come. So is that of
        streamed points, until the last of them is past.
        """
        stamp = header_stamp_ns(message)
        if not stamp or not self._is_streamed(message):
            return 0
        if len(message.points) == 1:
            return stamp
        end_ns = stamp + stamp_ns(message.points[-1].time_from_start)
        return end_ns if end_ns < self._ros_clock.now().nanoseconds else 0

    def _is_streamed(self, message: Any) -> bool:
        """Return True for points of the near past and future."""
        if not message.points:
            return False
        last_ns = stamp_ns(message.points[-1].time_from_start)
        stamp = header_stamp_ns(message)
        ahead_ns = last_ns
        if stamp and len(message.points) > 1:
            ahead_ns += stamp - self._ros_clock.now().nanoseconds
        longest_ns = STREAM_S * NANOSECONDS
        return ahead_ns <= longest_ns and last_ns <= 2 * longest_ns
