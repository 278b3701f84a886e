"""wmx_core_motion_node: single axes, by services and by topics, and their state at 100 Hz."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from rclpy.node import Node
from wmx_ros2_message.msg import AxisPose, AxisVelocity
from wmx_ros2_message.srv import GetWmxParams, LoadWmxParams, SetAxis, SetAxisGearRatio

from robotd.device.axes import each
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, RobotdError
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes import axis_conversions
from robotd.ros.nodes.axis_state_topic import RATE_HZ, AxisStateTopic
from robotd.ros.nodes.ready_topic import PERIOD_S, ReadyTopic
from robotd.ros.nodes.rejection_log import RejectionLog
from robotd.ros.services import add_service, add_subscription

COMMAND_DEPTH = 10
MAX_PATH = 4096  # characters, as Linux has it; a longer one is not worth a line of log
READY = "wmx/core_motion/ready"


class WmxCoreMotionNode(Node):
    """Axis services, motion topics and parameter files.

    A service request is checked whole before anything is done; then it is carried out axis by
    axis, and the response names every axis and what happened to it.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__("wmx_core_motion_node", context=host.context)
        self._axes = robot.axes
        self._connection = robot.connection
        self._refusals = RejectionLog()
        self._add_axis_services(host)
        add_service(self, host, LoadWmxParams, "wmx/params/load", self._load_parameters)
        add_service(self, host, GetWmxParams, "wmx/params/get", self._get_parameters)
        for message_type, topic, command in (
            (AxisVelocity, "wmx/axis/velocity", self._jog),
            (AxisPose, "wmx/axis/position", self._move),
            (AxisPose, "wmx/axis/position/relative", self._move_relative),
        ):
            handler = self._obey_or_tell(topic, command)
            add_subscription(self, host, message_type, topic, handler, COMMAND_DEPTH)
        state = AxisStateTopic(self, robot.image, robot.connection)
        rate_hz = min(RATE_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "axis state", state.publish)
        self.rates_hz = {state.topic: rate_hz, self.resolve_topic_name(READY): 1 / PERIOD_S}
        self._ready = ReadyTopic(self, robot.connection, READY)

    def _add_axis_services(self, host: RosHost) -> None:
        axes = self._axes
        modes = tuple(int(mode) for mode in CommandMode)
        for name, allowed, command in (
            ("set_on", (0, 1), lambda axis, data: axes.servo(axis, bool(data))),
            ("set_mode", modes, axes.set_command_mode),
            ("set_polarity", (1, -1), axes.set_polarity),
            ("clear_alarm", None, lambda axis, _: axes.clear_alarm(axis)),
            ("homing", None, lambda axis, _: axes.home(axis)),
        ):
            handler = self._axis_handler(allowed, command)
            add_service(self, host, SetAxis, f"wmx/axis/{name}", handler)
        add_service(self, host, SetAxisGearRatio, "wmx/axis/set_gear_ratio", self._set_gear_ratio)

    def _axis_handler(
        self, allowed: Collection[int] | None, command: Callable[[int, int], None]
    ) -> Callable[[Any, Any], Any]:
        """A SetAxis handler; ``allowed`` None: the command ignores the request's data."""

        def handle(request: Any, response: Any) -> Any:
            self._connection.require_ready()
            axes = axis_conversions.axis_numbers(request.index, len(self._axes))
            data = dict.fromkeys(axes, 0)
            if allowed is not None:
                data = axis_conversions.choices(axes, request.data, allowed)
            results = each(axes, lambda axis: command(axis, data[axis]))
            return axis_conversions.fill_outcome(response, self._axes.names, results)

        return handle

    def _set_gear_ratio(self, request: Any, response: Any) -> Any:
        self._connection.require_ready()
        ratios = axis_conversions.gear_ratios(request, len(self._axes))
        results = each(list(ratios), lambda axis: self._axes.set_gear_ratio(axis, *ratios[axis]))
        return axis_conversions.fill_outcome(response, self._axes.names, results)

    def _load_parameters(self, request: Any, response: Any) -> Any:
        length = len(request.file_path)
        if not 1 <= length <= MAX_PATH:
            raise InvalidArgument(f"file_path has {length} characters, not 1 to {MAX_PATH}")
        note = self._connection.load_parameters(Path(request.file_path))
        response.success = True
        response.message = f"{request.file_path} loaded{f'; {note}' if note else ''}"
        return response

    def _get_parameters(self, request: Any, response: Any) -> Any:
        count = len(self._axes)
        axes = axis_conversions.axis_numbers(request.index or range(count), count)
        response.params_dump = [self._connection.dump_parameters(axis) for axis in axes]
        response.success = True
        response.message = "ok"
        return response

    def _obey_or_tell(self, topic: str, command: Callable[[Any], None]) -> Callable[[Any], None]:
        def on_message(message: Any) -> None:
            try:
                command(message)
            except RobotdError as error:
                self._refusals.refused(topic, message.index, str(error))
            else:
                self._refusals.accepted(topic, message.index)

        return on_message

    def _jog(self, message: Any) -> None:
        self._axes.jog(axis_conversions.jogs(message))

    def _move(self, message: Any) -> None:
        self._axes.move(axis_conversions.moves(message))

    def _move_relative(self, message: Any) -> None:
        self._axes.move(axis_conversions.moves(message), relative=True)
