"""axis_reference_node: declares where axes are, by the service of WMX R2."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from wmx_r2_message.srv import SetAxisPosition

from robotd.api import InvalidArgument
from robotd.api.features import Robot
from robotd.device.axes import each
from robotd_ros.api import RosHost, add_service, no_parameters, read_settings
from robotd_ros.nodes import axis_conversions

NAME = "axis_reference_node"


class AxisReferenceNode(Node):
    """Declares the present position of axes to be 0, without motion; drivers have no other way."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        read_settings(self, robot.descriptor, no_parameters)
        self._axes = robot.axes
        add_service(self, host, SetAxisPosition, "wmx/axis/reference", self._reference)

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
