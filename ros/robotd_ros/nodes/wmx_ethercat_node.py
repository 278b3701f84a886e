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

from robotd.device.bus_status import BusState, BusStatus
from robotd.device.fieldbus import object_bytes, object_text
from robotd.errors import InvalidArgument
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.services import add_service, named_values

OBJECT = ("slave_id", "index", "subindex")
MAX_SIZE = 8

AL_STATES = {
    BusState.UNKNOWN: 0,  # None
    BusState.INITIALISING: 1,  # Init
    BusState.CONFIGURABLE: 2,  # Preop
    BusState.UPDATING: 4,  # Boot
    BusState.INPUTS_ONLY: 8,  # Safeop
    BusState.OPERATIONAL: 16,  # Op
}
"""Numbers of the vendor's interface; another bus is shown as the nearest state."""

# Response field → attribute or entry of ``extra`` of the bus, and of a node; 0 where not known.
_BUS = {
    "total_axes": "axes",
    "total_input_size": "input_size",
    "total_output_size": "output_size",
    "packet_loss": "lost_frames",
    "packet_timeout": "timeouts",
    "over_cycle": "late_cycles",
    "master_mode": "mode",
    "total_rxpdo_size": "rx_pdo_size",
    "total_txpdo_size": "tx_pdo_size",
    "tx_delay": "tx_delay",
    "min_tx_delay": "min_tx_delay",
    "max_tx_delay": "max_tx_delay",
}
_NODE = {
    "slave_ids": "id",
    "slave_al_codes": "error_code",
    "slave_positions": "position",
    "slave_addresses": "address",
    "slave_offline": "offline",
    "slave_vendor_ids": "vendor_id",
    "slave_product_codes": "product_code",
    "slave_revision_nos": "revision",
    "slave_serial_nos": "serial",
    "slave_input_sizes": "input_size",
    "slave_output_sizes": "output_size",
    "slave_num_of_axes": "axes",
    "slave_aliases": "alias",
    "slave_input_addrs": "input_address",
    "slave_output_addrs": "output_address",
}
_NODE_FLAGS = {
    "slave_inaccessible": "inaccessible",
    "slave_new": "new",
    "slave_reverse": "reverse",
}


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
    if known != numbers.keys() or any(type(number) is not int for number in numbers.values()):
        wanted = ", ".join((*required, *(f"[{name}]" for name in optional)))
        raise InvalidArgument(f"expected the whole numbers {wanted}; got {dict(fields)}")
    return numbers


def address(numbers: Mapping[str, int]) -> tuple[int, int, int, int]:
    """Return bus, node, index and subindex of a request."""
    return numbers["master_id"], numbers["slave_id"], numbers["index"], numbers["subindex"]


def fill_network_state(response: Any, status: BusStatus) -> Any:
    """Fill every field of an EcatGetNetworkState response; the slaves' arrays in parallel."""
    response.master_state = AL_STATES[status.state]
    response.comm_period = round(status.period_s * 1e6)
    response.ring_num = status.extra.get("rings", 1)
    values = {**status.extra, **vars(status)}
    for field, name in _BUS.items():
        setattr(response, field, values.get(name, 0))
    response.slave_states = [AL_STATES[node.state] for node in status.nodes]
    nodes = [{**node.extra, **vars(node)} for node in status.nodes]
    for field, name in _NODE.items():
        setattr(response, field, [node.get(name, 0) for node in nodes])
    for field, name in _NODE_FLAGS.items():
        setattr(response, field, [bool(node.get(name, 0)) for node in nodes])
    response.num_of_slaves = len(nodes)
    response.success = True
    response.message = status.note or f"{len(nodes)} slaves"
    return response
