"""wmx_ethercat_node: state, registers, statistics and objects of the fieldbus."""

from __future__ import annotations

from array import array
from typing import Any

from rclpy.node import Node
from robotd_msgs.srv import ReadObject, WriteObject
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
from robotd_ros.services import add_service

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
            (ReadObject, "read_object", self._read_object),
            (WriteObject, "write_object", self._write_object),
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

    def _read_object(self, request: Any, response: Any) -> str:
        data = self._fieldbus.read_object(*_address(request))
        response.data = array("B", data)
        return object_text(data)

    def _write_object(self, request: Any, response: Any) -> str:
        address = _address(request)
        size = request.size or len(self._fieldbus.read_object(*address))
        if not 1 <= size <= MAX_SIZE:
            raise InvalidArgument(f"size {size} is outside 1..{MAX_SIZE} bytes")
        self._fieldbus.write_object(*address, object_bytes(request.value, size))
        return self._read_object(request, response)


def _address(request: Any) -> tuple[int, int, int, int]:
    return request.bus, request.node, request.index, request.subindex


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
