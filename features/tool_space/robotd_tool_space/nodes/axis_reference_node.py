"""axis_reference_node: single axes by services of WMX R2, declared where they are or started."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from wmx_r2_message.srv import SetAxisPosition, StartAxesPose, StartAxesVelocity
from wmx_ros2_message.msg import AxisPose, AxisVelocity

from robotd.api import InvalidArgument
from robotd.api.robots import Robot, each
from robotd_ros.api import RosHost, add_service, no_parameters, read_settings
from robotd_ros.nodes import axis_conversions
from robotd_ros.nodes.axis_motion import AxisMotion
from robotd_ros.services import ServiceHandler

NAME = "axis_reference_node"


class AxisReferenceNode(Node):
    """Declares the present position of axes to be 0, without motion; drivers have no other way.

    And starts axes, as the topics of ``wmx_core_motion_node`` do, with an answer when they have
    begun.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        read_settings(self, robot.descriptor, no_parameters)
        self._axes = robot.axes
        add_service(self, host, SetAxisPosition, "wmx/axis/reference", self._reference)
        motion = AxisMotion(robot)
        for service_type, name, message_type, command in (
            (StartAxesPose, "start_pos", AxisPose, motion.move),
            (StartAxesPose, "start_mov", AxisPose, motion.move_relative),
            (StartAxesVelocity, "start_vel", AxisVelocity, motion.jog),
        ):
            handler = _starter(message_type, command)
            # In the executor thread, as the topics: a stop that arrives later comes later.
            add_service(self, host, service_type, f"wmx/axes/{name}", handler, blocking=False)

    def _reference(self, request: Any, response: Any) -> None:
        axes = list(request.index)
        self._axes.check_axes(axes)
        rows = axis_conversions.parallel(axes, position=request.position)
        for axis, (position,) in zip(axes, rows, strict=True):
            if position != 0.0:
                name = self._axes.names[axis]
                text = (
                    f"{name}: position {position:g} must be 0: a drive is referenced at zero only"
                )
                raise InvalidArgument(text)
        results = each(axes, self._axes.home)
        axis_conversions.fill_outcome(response, self._axes.names, results)


def _starter(message_type: Any, command: Callable[[Any, int], None]) -> ServiceHandler:
    """Return the handler of a request that ``command`` takes as a message."""

    def start(request: Any, response: Any) -> str:
        fields = {name: getattr(request, name) for name in request.get_fields_and_field_types()}
        command(message_type(index=fields.pop("axis"), **fields), 0)
        return "begun"

    return start
