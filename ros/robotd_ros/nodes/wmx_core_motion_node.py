"""wmx_core_motion_node: single axes, by services and by topics, and their state at 100 Hz."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from std_msgs.msg import Header
from wmx_ros2_message.msg import AxisPose, AxisState, AxisVelocity
from wmx_ros2_message.srv import GetWmxParams, LoadWmxParams, SetAxis, SetAxisGearRatio

from robotd.device.axes import each
from robotd.errors import InvalidArgument
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes import axis_conversions
from robotd_ros.nodes.axis_motion import POSITION, RELATIVE, VELOCITY, AxisJog, AxisMotion
from robotd_ros.nodes.command_subscription import RejectionLog, add_command_subscription
from robotd_ros.nodes.device_settings import read_core_motion
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.nodes.latched_topics import PERIOD_S, ReadyTopic
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.qos import STREAM
from robotd_ros.services import ServiceHandler, add_service

DEPTH = 10
COMMAND_DEPTH = 100  # of topics that are not streams: commands of one axis replace none of another
RATE_HZ = 100.0  # of the state
FRAME = "base_link"
MAX_PATH = 4096  # characters, as Linux has it; a longer one is not worth a line of log
READY = "wmx/core_motion/ready"
STATE = "wmx/axis/state"
JOG = "wmx/axis/jog"
JOG_TIMEOUT_S = 0.2  # jog_timeout_ms of the reference
COMMAND_TIMEOUT_S = 0.5  # age at which a command that has no dead-man is dropped

# Field of the message → array of the process image.
FIELDS = {
    "amp_alarm": "amp_alarm",
    "servo_on": "servo_on",
    "home_done": "home_done",
    "home_switch": "home_switch",
    "negative_ls": "negative_limit",
    "positive_ls": "positive_limit",
    "motion_complete": "motion_complete",
    "pos_cmd": "position_command",
    "velocity_cmd": "velocity_command",
    "actual_pos": "position",
    "actual_velocity": "velocity",
    "actual_torque": "torque",
}


@dataclass(frozen=True)
class _SetOn:
    """Request of ``set_on``. ``offs``: ``Axes.servo_offs`` when it arrived."""

    index: Sequence[int]
    data: Sequence[int]
    offs: Sequence[int]


class WmxCoreMotionNode(Node):
    """Axis services, motion topics and parameter files.

    A service request is checked whole before anything is done; then it is carried out axis by
    axis, and the response names every axis and what happened to it.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__("wmx_core_motion_node", context=host.context)
        prefix = read_settings(self, robot.descriptor, read_core_motion)
        self._axes, self._interruptions = robot.axes, robot.rearming.interruptions
        self._connection = robot.connection
        self._rejections = RejectionLog(host)
        self._add_axis_services(host)
        add_service(self, host, LoadWmxParams, "wmx/params/load", self._load_parameters)
        add_service(self, host, GetWmxParams, "wmx/params/get", self._get_parameters)
        motion = AxisMotion(robot)
        jog = AxisJog(robot, host, JOG, JOG_TIMEOUT_S)
        targets = partial(axis_conversions.axes_of, count=len(robot.axes))
        for message_type, topic, command, qos, limit_s in (
            (AxisVelocity, VELOCITY, motion.jog, COMMAND_DEPTH, _velocity_timeout_s),
            (AxisPose, POSITION, motion.move, COMMAND_DEPTH, COMMAND_TIMEOUT_S),
            (AxisPose, RELATIVE, motion.move_relative, COMMAND_DEPTH, COMMAND_TIMEOUT_S),
            (AxisVelocity, JOG, jog.take, STREAM, JOG_TIMEOUT_S),
        ):
            handler = self._execute_or_log(topic, command)
            add_command_subscription(
                self, host, robot, message_type, topic, handler, qos, limit_s, targets=targets
            )
        add_service(self, host, SetAxis, "wmx/axis/stop", self._stop, urgent=True)
        state = HotTopics(self, robot)
        arrays = {field: getattr(robot.image, name) for field, name in FIELDS.items()}
        zeros = {field: np.zeros_like(array).tolist() for field, array in arrays.items()}
        template = AxisState(header=Header(frame_id=prefix + FRAME), **zeros)
        topic = state.add(STATE, DEPTH, template, sources=arrays).topic
        rate_hz = min(RATE_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "axis state", state.publish)
        self.rates_hz = {topic: rate_hz, self.resolve_topic_name(READY): 1 / PERIOD_S}
        self._ready = ReadyTopic(self, robot.connection, READY)

    def _add_axis_services(self, host: RosHost) -> None:
        axes = self._axes
        for name, fields, check, command in (
            ("set_mode", ("data",), axes.check_command_mode, axes.set_command_mode),
            ("set_polarity", ("data",), axes.check_polarity, axes.set_polarity),
            ("clear_alarm", (), None, axes.clear_alarm),
            ("homing", (), None, axes.home),
        ):
            handler = self._axis_handler(fields, check, command)
            add_service(self, host, SetAxis, f"wmx/axis/{name}", handler)
        add_service(
            self,
            host,
            SetAxis,
            "wmx/axis/set_on",
            self._set_on,
            urgent=_switches_off,
            on_arrival=lambda request: _SetOn(request.index, request.data, axes.servo_offs),
        )
        handler = self._axis_handler(
            ("numerator", "denominator"), axes.check_gear_ratio, axes.set_gear_ratio
        )
        add_service(self, host, SetAxisGearRatio, "wmx/axis/set_gear_ratio", handler)

    def _axis_handler(
        self,
        fields: tuple[str, ...],
        check: Callable[..., object] | None,
        command: Callable[..., None],
    ) -> ServiceHandler:
        """Handler of a request that commands several axes.

        Args:
            fields: arrays of the request that are the arguments of check and command.
            check: called for every axis before the first command; raises to reject the request.
            command: called for one axis after the other.
        """

        def handle(request: Any, response: Any) -> None:
            axes = list(request.index)
            self._axes.check_axes(axes)
            columns = {field: getattr(request, field) for field in fields}
            rows = dict(zip(axes, axis_conversions.parallel(axes, **columns), strict=True))
            for axis, values in rows.items():
                if check is not None:
                    check(axis, *values)
            results = each(axes, lambda axis: command(axis, *rows[axis]))
            axis_conversions.fill_outcome(response, self._axes.names, results)

        return handle

    def _group_note(self, axis: int) -> str:
        """Name the axes that were switched together with ``axis``."""
        group = self._axes.servo_group(axis)
        others = [self._axes.names[other] for other in group if other != axis]
        return f" (one servo switch with {', '.join(others)})" if others else ""

    def _set_on(self, request: _SetOn, response: Any) -> None:
        """Switch servos: off first, in any state of the device, then on.

        A request to switch off overtakes those that wait; they switch nothing on afterwards.
        """
        axes = list(request.index)
        self._axes.stop_latch.check_commandable()
        self._axes.check_numbers(axes)
        wanted = dict(zip(axes, axis_conversions.parallel(axes, data=request.data), strict=True))
        for axis, (data,) in wanted.items():
            axis_conversions.check_flag(axis, data)
        on = [axis for axis, (data,) in wanted.items() if data]
        if len(on) == len(axes):
            self._axes.check_axes(axes)
        results = dict(self._axes.servos_off([axis for axis in axes if axis not in on]))
        results |= each(on, lambda axis: self._axes.servo(axis, True, offs=request.offs))
        ordered = {axis: results[axis] for axis in axes}
        notes = {axis: self._group_note(axis) for axis in axes}
        axis_conversions.fill_outcome(response, self._axes.names, ordered, notes)

    def _load_parameters(self, request: Any, response: Any) -> str:
        length = len(request.file_path)
        if not 1 <= length <= MAX_PATH:
            raise InvalidArgument(f"file_path has {length} characters, not 1 to {MAX_PATH}")
        note = self._connection.load_parameters(Path(request.file_path))
        return f"{request.file_path} loaded{f'; {note}' if note else ''}"

    def _get_parameters(self, request: Any, response: Any) -> str:
        axes = list(request.index) or list(range(len(self._axes)))
        self._axes.check_numbers(axes)
        response.params_dump = [
            line
            for axis in axes
            for line in axis_conversions.parameter_lines(
                axis, self._connection.dump_parameters(axis)
            )
        ]
        return "ok"

    def _execute_or_log(
        self, topic: str, command: Callable[[Any, int], None]
    ) -> Callable[[Any, int], None]:
        def on_message(message: Any, sent_ns: int) -> None:
            with self._rejections.noting(topic, message.index):
                command(message, sent_ns)

        return on_message

    def _stop(self, request: Any, response: Any) -> None:
        axes = list(request.index)
        self._axes.check_numbers(axes)
        self._interruptions.add(axes, "stopped by wmx/axis/stop")
        self._axes.stop(axes)
        axis_conversions.fill_outcome(response, self._axes.names, dict.fromkeys(axes))


def _switches_off(request: Any) -> bool:
    return not all(request.data)


def _velocity_timeout_s(message: Any) -> float:
    """Return the age at which a velocity is dropped: never where it stops its axes."""
    return COMMAND_TIMEOUT_S if any(message.velocity) else math.inf
