"""wmx_ethercat_node: state, registers, statistics and objects of the fieldbus."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from wmx_ros2_message.srv import (
    EcatGetNetworkState,
    EcatRegisterRead,
    EcatResetStatistics,
    EcatStartHotconnect,
)

from robotd.device.fieldbus import object_bytes, object_text
from robotd.errors import InvalidArgument
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.ethercat_conversions import fill_network_state
from robotd_ros.services import add_service, named_values

OBJECT = ("slave_id", "index", "subindex")
MAX_SIZE = 8


class WmxEthercatNode(Node):
    """Services of diagnostics and of objects (SDO); the latter answer the value in the node."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__("wmx_ethercat_node", context=host.context)
        self._fieldbus = robot.fieldbus
        for service_type, name, handler in (
            (EcatGetNetworkState, "get_network_state", self._get_network_state),
            (EcatRegisterRead, "register_read", self._register_read),
            (EcatResetStatistics, "reset_statistics", self._reset_statistics),
            (EcatStartHotconnect, "start_hotconnect", self._start_hot_connect),
            (SetParametersAtomically, "read_object", named_values(self._read_object)),
            (SetParametersAtomically, "write_object", named_values(self._write_object)),
        ):
            add_service(self, host, service_type, f"wmx/ecat/{name}", handler)

    def _get_network_state(self, request: Any, response: Any) -> None:
        fill_network_state(response, self._fieldbus.status(request.master_id))

    def _register_read(self, request: Any, response: Any) -> str:
        data = self._fieldbus.read_register(
            request.master_id, request.slave_id, request.reg_address, request.length
        )
        response.data = array("B", data)
        return f"{len(data)} bytes"

    def _reset_statistics(self, request: Any, response: Any) -> str:
        self._fieldbus.reset_statistics(request.master_id)
        return "statistics reset"

    def _start_hot_connect(self, request: Any, response: Any) -> str:
        self._fieldbus.start_hot_connect(request.master_id)
        return "hot connect started"

    def _read_object(self, fields: dict[str, Any]) -> str:
        numbers = whole_numbers(fields, OBJECT, {"master_id": 0})
        return object_text(self._fieldbus.read_object(*address(numbers)))

    def _write_object(self, fields: dict[str, Any]) -> str:
        numbers = whole_numbers(fields, (*OBJECT, "value"), {"master_id": 0, "size": 0})
        where = address(numbers)
        size = numbers["size"] or len(self._fieldbus.read_object(*where))
        if not 1 <= size <= MAX_SIZE:
            raise InvalidArgument(f"size {size} is outside 1..{MAX_SIZE} bytes")
        self._fieldbus.write_object(*where, object_bytes(numbers["value"], size))
        return object_text(self._fieldbus.read_object(*where))


def whole_numbers(
    fields: Mapping[str, Any], required: tuple[str, ...], optional: Mapping[str, int]
) -> dict[str, int]:
    """Return the values of a request. Raises InvalidArgument for a missing or unknown one."""
    numbers = {**optional, **fields}
    known = {*required, *optional}
    if known != numbers.keys() or any(type(each) is not int for each in numbers.values()):
        wanted = ", ".join((*required, *(f"[{name}]" for name in optional)))
        raise InvalidArgument(f"expected the whole numbers {wanted}; got {dict(fields)}")
    return numbers


def address(numbers: Mapping[str, int]) -> tuple[int, int, int, int]:
    """Return bus, node, index and subindex of a request."""
    return numbers["master_id"], numbers["slave_id"], numbers["index"], numbers["subindex"]
