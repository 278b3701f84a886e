"""robotd: the node of the operator, beside the others of every robot."""

from __future__ import annotations

import threading
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from std_msgs.msg import Empty, Float64, String
from std_srvs.srv import Trigger

from robotd.errors import InvalidArgument, RobotdError
from robotd.node_settings.device_settings import read_frame_prefix
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.node_registry import OPERATOR_NODE
from robotd.ros.nodes.named_io import NamedIo
from robotd.ros.nodes.node_parameters import Parameters
from robotd.ros.nodes.owner_topic import OwnerTopic
from robotd.ros.nodes.ready_topic import publish_if_alive
from robotd.ros.nodes.tool_pose_topic import ToolPoseTopic
from robotd.ros.qos import LATCHED
from robotd.ros.services import add_service, add_subscription, named_values


class OperatorNode(Node):
    """Services for the operator of a robot: recovery, stop, speed, and named inputs and outputs."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(OPERATOR_NODE, context=host.context)
        self._recovery = _RecoveryService(self, robot, host)
        self._stop = _StopServices(self, robot, host)
        self._speed = _SpeedServices(self, robot, host)
        self._owners = OwnerTopic(self, robot)
        self._io = NamedIo(self, robot, host)
        parameters = Parameters(self, robot.descriptor)
        self._tool = ToolPoseTopic(self, robot, read_frame_prefix(parameters))
        parameters.done()


class _SpeedServices:
    """``~/set_speed`` as service and topic, ``~/pause``, ``~/resume``, and ``~/speed``."""

    def __init__(self, node: Node, robot: Robot, host: RosHost) -> None:
        self._robot = robot
        self._publisher = node.create_publisher(Float64, "~/speed", LATCHED)
        add_service(node, host, SetParametersAtomically, "~/set_speed", named_values(self._set))
        add_service(node, host, Trigger, "~/pause", self._pause, urgent=True)
        add_service(node, host, Trigger, "~/resume", self._resume)
        add_subscription(node, host, Float64, "~/set_speed", self._set_by_message, 1)
        robot.axes.speed.on_change(self._publish)

    def _set(self, fields: dict[str, Any]) -> str:
        speed = fields.get("speed")
        if (
            list(fields) != ["speed"]
            or isinstance(speed, bool)
            or not isinstance(speed, (int, float))
        ):
            raise InvalidArgument(f"expected the number 'speed', got {fields}")
        self._robot.set_speed(float(speed))
        return self._robot.axes.speed.text

    def _set_by_message(self, message: Any) -> None:
        self._robot.set_speed(message.data)

    def _pause(self, request: Any, response: Any) -> str:
        self._robot.pause()
        return self._robot.axes.speed.text

    def _resume(self, request: Any, response: Any) -> str:
        self._robot.resume()
        return self._robot.axes.speed.text

    def _publish(self, scale: float) -> None:
        publish_if_alive(self._publisher, Float64(data=scale))


class _StopServices:
    """``~/stop`` as service and topic, ``~/reset``, and the reason of the stop on ``~/stopped``."""

    def __init__(self, node: Node, robot: Robot, host: RosHost) -> None:
        self._robot = robot
        self._publisher = node.create_publisher(String, "~/stopped", LATCHED)
        add_service(node, host, Trigger, "~/stop", self._stop, urgent=True)
        add_service(node, host, Trigger, "~/reset", self._reset)
        add_subscription(node, host, Empty, "~/stop", self._engage, 1)
        robot.axes.stop_latch.on_change(self._publish)

    def _stop(self, request: Any, response: Any) -> str:
        self._robot.stop("by a client of the stop service")
        return "stopped, at rest"

    def _engage(self, message: Any) -> None:
        """Executor thread: the control loop brings everything to rest."""
        self._robot.axes.stop_latch.engage("by a message on the stop topic")

    def _reset(self, request: Any, response: Any) -> str:
        return self._robot.reset()

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

    def _recover(self, request: Any, response: Any) -> str:
        with self._lock:
            self._lines = []
            try:
                self._robot.recover(self._report)
            except RobotdError as error:
                self._report("; ".join(["failed", *map(str.strip, str(error).splitlines())]))
                raise
            return "\n".join(self._lines)

    def _report(self, line: str) -> None:
        self._lines.append(line)
        publish_if_alive(self._publisher, String(data="\n".join(self._lines)))
