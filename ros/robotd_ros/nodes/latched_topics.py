"""Latched topics: readiness, the URDF, the log, and the summary of a robot for lists of several."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Self

from rcl_interfaces.msg import Log
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Bool, String

from robotd.clock import NANOSECONDS
from robotd.control.groups.problem import Problem, ProblemKind
from robotd.device.connection import Connection
from robotd.log import LogLine, add_listener, remove_listener
from robotd.observation.robot_identity import identity
from robotd.robot import Robot
from robotd_ros.middleware import NODE_GONE
from robotd_ros.node_names import SUMMARY
from robotd_ros.qos import LATCHED, ROSOUT

PERIOD_S = 1.0
LEVELS = {"debug": Log.DEBUG, "info": Log.INFO, "warning": Log.WARN, "critical": Log.FATAL}
LOOK_PERIOD_S = 0.25
HEARTBEAT_S = 1.0  # a list shows a robot whose computer has gone long before discovery does

MAX_PROBLEMS = 8
READY = "ready"
# The first of these kinds that a robot has is its state.
STATES = {
    ProblemKind.ENDING: "shutting down",
    ProblemKind.STARTING: "starting",
    ProblemKind.DEVICE: "no device",
    ProblemKind.CONTROLLER: "fault",
    ProblemKind.ALARM: "fault",
    ProblemKind.OFFLINE: "fault",
    ProblemKind.NOT_STOPPED: "fault",
    ProblemKind.STOPPED: "stopped",
    ProblemKind.SERVO_OFF: "servo off",
}


class ReadyTopic:
    """Publishes ``engine.ready`` on every change and once a second, for the life of the node."""

    def __init__(self, node: Node, connection: Connection, topic: str) -> None:
        self._connection = connection
        self._publisher = node.create_publisher(Bool, topic, LATCHED)
        self._lock = threading.Lock()
        # Wall time that no clock jump and no simulated clock can stop.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self._publish, clock=steady)
        connection.on_ready(lambda ready: self._publish())

    def _publish(self) -> None:
        """Publish the value that is current under the lock. Any thread."""
        with self._lock:
            publish_if_alive(self._publisher, Bool(data=self._connection.ready))


def publish_if_alive(publisher: Publisher, message: Any) -> None:
    """Publish, unless the node is gone; the robot outlives it where a program has both."""
    with suppress(*NODE_GONE):
        publisher.publish(message)


def publish_description(node: Node, description: str) -> None:
    """Publish a URDF once, as robot_state_publisher has it; an empty one is not published."""
    if description:
        node.create_publisher(String, "robot_description", LATCHED).publish(
            String(data=description)
        )


class RosoutTopic:
    """Publishes the lines of the log: ``with RosoutTopic(node):``.

    Each is published by the thread that logs it; the name is that of the node, a dot, and the
    component.
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(Log, "/rosout", ROSOUT)
        self._name = node.get_logger().name

    def __enter__(self) -> Self:
        add_listener(self._publish)
        return self

    def __exit__(self, *_: object) -> None:
        remove_listener(self._publish)

    def _publish(self, line: LogLine) -> None:
        message = Log(
            level=LEVELS.get(line.level, Log.ERROR),
            name=f"{self._name}.{line.component}",
            msg=line.text,
        )
        message.stamp.sec, message.stamp.nanosec = divmod(time.time_ns(), NANOSECONDS)
        publish_if_alive(self._publisher, message)


class SummaryTopic:
    """Publishes the summary of a robot where it changes and once a second. One thread.

    Args:
        features: names of those that run.
    """

    def __init__(self, node: Node, robot: Robot, features: Sequence[str]) -> None:
        self._node, self._robot = node, robot
        self._identity = {**identity(robot, node.get_namespace()), "features": [*features]}
        self._began_s = time.monotonic()
        self._problems: Sequence[Problem] = ()
        self._shown: dict[str, Any] = {}
        self._look_s = self._due_s = 0.0
        self._publisher = node.create_publisher(String, SUMMARY, LATCHED)

    def look(self, problems: Sequence[Problem]) -> None:
        """Publish it if it is time to, or if something changed.

        ``problems``: of the robot, now. Raises InvalidHandle when the node is gone.
        """
        now_s = time.monotonic()
        if problems == self._problems and now_s < self._look_s:
            return
        self._problems, self._look_s = problems, now_s + LOOK_PERIOD_S
        summary = robot_summary(self._robot, problems)
        # A new client discovers one robot before the other one, and has to know of it all the same.
        summary["sharing"] = max(0, self._node.count_publishers(SUMMARY) - 1)
        if summary == self._shown and now_s < self._due_s:
            return
        self._shown, self._due_s = summary, now_s + HEARTBEAT_S
        uptime_s = round(now_s - self._began_s)
        message = {**self._identity, **summary, "uptime_s": uptime_s}
        publish_if_alive(self._publisher, String(data=json.dumps(message)))


def robot_summary(robot: Robot, problems: Sequence[Problem]) -> dict[str, Any]:
    """Return what changes in a list of robots, as JSON. Any thread.

    ``state`` is "ready" or one of ``STATES``; ``problems`` are texts, the root cause first;
    ``owners`` names the clients that move axes.
    """
    kinds = {problem.kind for problem in problems}
    found = next((text for kind, text in STATES.items() if kind in kinds), READY)
    state = found if found != READY or robot.connection.ready else STATES[ProblemKind.DEVICE]
    axes = robot.axes
    owners = {axes.owner(axis) for axis in range(len(axes))} - {""}
    return {
        "state": state,
        "problems": [problem.text for problem in problems[:MAX_PROBLEMS]],
        "owners": sorted(owners),
    }
