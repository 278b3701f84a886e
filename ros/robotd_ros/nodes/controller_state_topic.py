"""State topic and query service of joint_trajectory_controller."""

from __future__ import annotations

from typing import Any

import numpy as np
from control_msgs.msg import JointTrajectoryControllerState
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectoryPoint

from robotd.clock import Clock
from robotd.control.joint_group import JointGroup
from robotd.device.process_image import ProcessImage, columns
from robotd.robot import Robot
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.nodes.trajectory_conversions import clock_time_ns, stamp_ns

DEPTH = 10
SPEED = "speed_scaling_factor"
POINTS = ("reference", "output", "feedback", "error")


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
