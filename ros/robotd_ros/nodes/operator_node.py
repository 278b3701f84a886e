"""robotd: the operator's node, one of every robot."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Sequence
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from robotd_msgs.msg import AxisOwners, CommandRejection, IoLevels, RecoveryReport
from robotd_msgs.srv import GetPayload, SetPayload, SetSpeed
from std_msgs.msg import Bool, Empty, Float64, String
from std_srvs.srv import SetBool, Trigger

from robotd.control.groups.problem import Problem
from robotd.device.payload import Payload
from robotd.device.process_image import ProcessImage
from robotd.observation.robot_identity import identity
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.node_names import IDENTITY, OPERATOR_NODE, STOP_ALL
from robotd_ros.nodes.command_subscription import add_command_subscription
from robotd_ros.nodes.device_settings import read_frame_prefix
from robotd_ros.nodes.latched_topics import SummaryTopic, publish_if_alive
from robotd_ros.nodes.node_parameters import Parameters
from robotd_ros.nodes.tool_pose_topic import ToolPoseTopic
from robotd_ros.operator_messages import (
    LEVELS,
    OWNERS,
    RECOVERY,
    REJECTIONS,
    levels_message,
    owners_message,
)
from robotd_ros.problem_messages import problem_array
from robotd_ros.qos import LATCHED
from robotd_ros.services import add_service, add_subscription

STATE_RATE_HZ = 10.0
SPEED_TIMEOUT_S = 1.0  # age at which a message that raises the speed is dropped
IO_RATE_HZ = 50.0


class OperatorNode(Node):
    """Services for the operator of a robot: recovery, stop, speed, and named I/O.

    Latched topics have what they changed: ``~/stopped`` the reason of a stop, ``~/speed``,
    ``~/recovery`` the report of the present or last recovery, ``~/owners`` the axes that have one,
    ``~/problems`` what keeps axes from moving, ``~/robot`` which robot it is, ``~/summary`` its
    state in a list of several.
    ``~/rejections`` has the commands of topics that are rejected, as the log has them.

    Args:
        host: its workers answer.
        features: names of those that run.
    """

    def __init__(self, robot: Robot, host: RosHost, features: Sequence[str] = ()) -> None:
        super().__init__(OPERATOR_NODE, context=host.context)
        self._robot = robot
        self._recovery_lock = threading.Lock()
        self._owners: dict[str, str] | None = None  # not published yet
        self._stopped_topic = self.create_publisher(String, "~/stopped", LATCHED)
        self._speed_topic = self.create_publisher(Float64, "~/speed", LATCHED)
        self._recovery_topic = self.create_publisher(RecoveryReport, RECOVERY, LATCHED)
        self._owners_topic = self.create_publisher(AxisOwners, OWNERS, LATCHED)
        self._problems_topic = self.create_publisher(DiagnosticArray, "~/problems", LATCHED)
        self._problems: list[Problem] | None = None  # not published yet
        self._rejections_topic = self.create_publisher(CommandRejection, REJECTIONS, 10)
        self._recovery_topic.publish(RecoveryReport())
        self._robot_topic = self.create_publisher(String, IDENTITY, LATCHED)
        told = {**identity(robot, self.get_namespace()), "features": [*features]}
        self._robot_topic.publish(String(data=json.dumps(told)))
        self._summary = SummaryTopic(self, robot, features)
        for service_type, name, handler, urgent in (
            (Trigger, "stop", self._stop, True),
            (Trigger, "reset", lambda *_: robot.reset(), False),
            (Trigger, "pause", lambda *_: robot.pause(), True),
            (Trigger, "resume", lambda *_: robot.resume(), False),
            (Trigger, "recover", self._recover, False),
            *([(Trigger, "home_gripper", self._home_gripper, False)] if robot.gripper else []),
            (SetPayload, "set_payload", self._set_payload, False),
            (GetPayload, "get_payload", self._get_payload, False),
            (SetSpeed, "set_speed", lambda asked, _: robot.set_speed(asked.speed), False),
        ):
            add_service(self, host, service_type, f"~/{name}", handler, urgent=urgent)
        for topic in ("~/stop", STOP_ALL):
            add_subscription(self, host, Empty, topic, self._engage_stop, 1)
        add_command_subscription(
            self,
            host,
            robot,
            Float64,
            "~/set_speed",
            lambda message, _: robot.set_speed(message.data),
            1,
            self._speed_timeout_s,
        )
        robot.axes.stop_latch.on_change(self._publish_stopped)
        robot.axes.speed.on_change(self._publish_speed)
        rate_hz = min(STATE_RATE_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "owners", self._publish_owners, first=True)
        self._io = NamedIo(self, robot, host)
        parameters = Parameters(self, robot.descriptor)
        self._tool = ToolPoseTopic(self, robot, read_frame_prefix(parameters))
        parameters.done()

    def _stop(self, request: Any, response: Any) -> str:
        self._robot.stop("by a client of the stop service")
        return "stopped, at rest"

    def _home_gripper(self, request: Any, response: Any) -> str:
        if (gripper := self._robot.gripper) is not None:
            gripper.home()
        return "gripper homed"

    def _set_payload(self, request: Any, response: Any) -> str:
        center = request.center
        payload = Payload(request.mass_kg, (center.x, center.y, center.z))
        self._robot.payload.set_payload(payload)
        return str(payload)

    def _get_payload(self, request: Any, response: Any) -> str:
        payload = self._robot.payload.current()
        response.known = payload is not None
        if payload is None:
            return "the device does not tell its payload"
        response.mass_kg, center = payload.mass_kg, response.center
        center.x, center.y, center.z = payload.center_m
        return str(payload)

    def _engage_stop(self, message: Any) -> None:
        """Executor thread: the control loop brings everything to rest."""
        self._robot.axes.stop_latch.engage("by a message on the stop topic")

    def _publish_stopped(self, reason: str) -> None:
        publish_if_alive(self._stopped_topic, String(data=reason))

    def _speed_timeout_s(self, message: Any) -> float:
        """Return the age at which a speed is dropped: never where it slows down."""
        slows = message.data <= self._robot.axes.speed.speed
        return math.inf if slows else SPEED_TIMEOUT_S

    def _publish_speed(self, scale: float) -> None:
        publish_if_alive(self._speed_topic, Float64(data=scale))

    def _recover(self, request: Any, response: Any) -> str:
        steps: list[str] = []

        def report(*, running: bool, failure: str = "") -> None:
            message = RecoveryReport(running=running, steps=steps, failure=failure)
            publish_if_alive(self._recovery_topic, message)

        def report_step(line: str) -> None:
            steps.append(line)
            report(running=True)

        with self._recovery_lock:
            report(running=True)
            try:
                self._robot.recover(report_step)
            except Exception as error:
                report(running=False, failure=str(error))
                raise
            report(running=False)
        return "\n".join(steps)

    def _publish_owners(self, image: ProcessImage) -> None:
        """Publish the owners where they have changed. Control loop."""
        axes = self._robot.axes
        owners = {name: who for axis, name in enumerate(axes.names) if (who := axes.owner(axis))}
        if owners != self._owners:
            self._owners = owners
            publish_if_alive(self._owners_topic, owners_message(owners))

    def publish_problems(self, problems: list[Problem]) -> None:
        """Publish what keeps axes from moving where it has changed, and the summary. One thread.

        Raises InvalidHandle when the node is gone.
        """
        self._summary.look(problems)
        if problems != self._problems:
            self._problems = problems
            now_ns = self.get_clock().now().nanoseconds
            ahead_ns = now_ns - self._robot.clock.now_ns()
            publish_if_alive(self._problems_topic, problem_array(problems, now_ns, ahead_ns))

    def publish_rejection(self, topic: str, axes: Sequence[int], reason: str) -> None:
        """Publish that a command on ``topic`` was rejected. Any thread."""
        rejection = CommandRejection(topic=topic, axes=[*axes], reason=reason)
        publish_if_alive(self._rejections_topic, rejection)


class NamedIo:
    """``~/inputs/NAME`` and ``~/outputs/NAME`` of the names in the descriptor.

    A topic has the level on every change, while the device communicates. ``~/io`` has all of them.
    """

    def __init__(self, node: Node, robot: Robot, host: RosHost) -> None:
        self._io, self._connection = robot.io, robot.connection
        self._overview = node.create_publisher(IoLevels, LEVELS, LATCHED)
        io = robot.io
        self._readers = {("inputs", name): io.input_watcher(*io.inputs[name]) for name in io.inputs}
        self._readers |= {
            ("outputs", name): io.output_watcher(*io.outputs[name]) for name in io.outputs
        }
        self._publishers = {
            (kind, name): node.create_publisher(Bool, f"~/{kind}/{name}", LATCHED)
            for kind, name in self._readers
        }
        self._levels: dict[tuple[str, str], bool | None] | None = None  # not published yet
        for name in io.outputs:
            handler = partial(self._set, name)
            add_service(node, host, SetBool, f"~/outputs/{name}", handler)
        rate_hz = min(IO_RATE_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "named I/O", self.publish, first=True)

    def publish(self, image: ProcessImage) -> None:
        """Publish the levels that have changed. Control loop."""
        ready = self._connection.ready
        levels = {key: read() if ready else None for key, read in self._readers.items()}
        if levels == self._levels:
            return
        before, self._levels = self._levels or {}, levels
        overview: dict[str, dict[str, bool | None]] = {"inputs": {}, "outputs": {}}
        for (kind, name), level in levels.items():
            overview[kind][name] = level
            if level is not None and level != before.get((kind, name)):
                publish_if_alive(self._publishers[kind, name], Bool(data=level))
        publish_if_alive(self._overview, levels_message(**overview))

    def _set(self, name: str, request: Any, response: Any) -> str:
        self._io.set_output(name, request.data)
        return f"{name}: {'on' if request.data else 'off'}"
