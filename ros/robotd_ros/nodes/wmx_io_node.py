"""wmx_io_node: the digital I/O image, bit by bit and in blocks."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from wmx_ros2_message.srv import GetIoBit, GetIoBytes, SetIoBit, SetIoBytes

from robotd.errors import InvalidArgument
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.services import add_service


class WmxIoNode(Node):
    """Six services on the I/O image: reads use memory only, writes wait for the driver."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__("wmx_io_node", context=host.context)
        self._io = robot.io
        for service_type, name, handler, writes in (
            (GetIoBit, "get_input_bit", partial(_get_bit, robot.io.input_bit), False),
            (GetIoBit, "get_output_bit", partial(_get_bit, robot.io.output_bit), False),
            (GetIoBytes, "get_input_bytes", partial(_get_bytes, robot.io.input_bytes), False),
            (GetIoBytes, "get_output_bytes", partial(_get_bytes, robot.io.output_bytes), False),
            (SetIoBit, "set_output_bit", self._set_output_bit, True),
            (SetIoBytes, "set_output_bytes", self._set_output_bytes, True),
        ):
            add_service(self, host, service_type, f"wmx/io/{name}", handler, blocking=writes)

    def _set_output_bit(self, request: Any, response: Any) -> str:
        if request.value not in (0, 1):
            raise InvalidArgument(f"value {request.value} is not 0 or 1")
        self._io.set_output_bit(request.byte, request.bit, bool(request.value))
        return "ok"

    def _set_output_bytes(self, request: Any, response: Any) -> str:
        self._io.set_output_bytes(request.byte, bytes(request.data))
        return "ok"


def _get_bit(read: Callable[[int, int], bool], request: Any, response: Any) -> str:
    response.value = int(read(request.byte, request.bit))
    return "ok"


def _get_bytes(read: Callable[[int, int], bytes], request: Any, response: Any) -> str:
    response.data = array("B", read(request.byte, request.length))
    return "ok"
