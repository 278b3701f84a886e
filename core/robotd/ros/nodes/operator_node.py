"""robotd: the node of the operator, beside the others of every robot."""

from __future__ import annotations

import threading
from typing import Any

from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from robotd.errors import RobotdError
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.node_registry import OPERATOR_NODE
from robotd.ros.nodes.ready_topic import LATCHED
from robotd.ros.services import add_service


class OperatorNode(Node):
    """Services for the operator of a robot: recovery."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(OPERATOR_NODE, context=host.context)
        self._recovery = _RecoveryService(self, robot, host)


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
        try:
            self._publisher.publish(String(data="\n".join(self._lines)))
        except (InvalidHandle, RCLError):
            return  # the node is gone
