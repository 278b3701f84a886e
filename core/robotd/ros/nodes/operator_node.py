"""robotd: the node of the operator, beside the others of every robot."""

from __future__ import annotations

import threading
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from robotd.errors import RobotdError
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.node_registry import OPERATOR_NODE
from robotd.ros.nodes.ready_topic import LATCHED, publish_if_alive
from robotd.ros.services import add_service, add_subscription


class OperatorNode(Node):
    """Services for the operator of a robot: recovery, and the stop of all motion."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(OPERATOR_NODE, context=host.context)
        self._recovery = _RecoveryService(self, robot, host)
        self._stop = _StopServices(self, robot, host)


class _StopServices:
    """``~/stop`` as service and topic, ``~/reset``, and the reason of the stop on ``~/stopped``."""

    def __init__(self, node: Node, robot: Robot, host: RosHost) -> None:
        self._robot = robot
        self._publisher = node.create_publisher(String, "~/stopped", LATCHED)
        add_service(node, host, Trigger, "~/stop", self._stop, urgent=True)
        add_service(node, host, Trigger, "~/reset", self._reset)
        add_subscription(node, host, Empty, "~/stop", self._engage, 1)
        robot.axes.stop_latch.on_change(self._publish)

    def _stop(self, request: Any, response: Any) -> Any:
        self._robot.stop("by a client of the stop service")
        response.success, response.message = True, "stopped, at rest"
        return response

    def _engage(self, message: Any) -> None:
        """Executor thread: the control loop brings everything to rest."""
        self._robot.axes.stop_latch.engage("by a message on the stop topic")

    def _reset(self, request: Any, response: Any) -> Any:
        response.success, response.message = True, self._robot.reset()
        return response

    def _publish(self, reason: str) -> None:
        publish_if_alive(self._publisher, String(data=reason))


class _RecoveryService:
    """``~/recover``, and the report of the present or last recovery on ``~/recovery``."""

    def __init__(self, node: Node, robot: Robot, host: RosHost) -> None:
        self._robot = robot
        self._lines: list[str] = []
        self._lock = threading.Lock()
        self._publisher = node.create_publisher(String, "~/recovery", LATCHED)
        self._publisher.publish(String())
        add_service(node, host, Trigger, "~/recover", self._recover)

    def _recover(self, request: Any, response: Any) -> Any:
        with self._lock:
            self._lines = []
            try:
                self._robot.recover(self._report)
            except RobotdError as error:
                self._report("; ".join(["failed", *map(str.strip, str(error).splitlines())]))
                raise
            response.success, response.message = True, "\n".join(self._lines)
            return response

    def _report(self, line: str) -> None:
        self._lines.append(line)
        publish_if_alive(self._publisher, String(data="\n".join(self._lines)))
