"""wmx_ethercat_node: state, registers, statistics and objects of the fieldbus."""

from __future__ import annotations

from array import array
from typing import Any

from rclpy.node import Node
from wmx_ros2_message.srv import (
    EcatGetNetworkState,
    EcatRegisterRead,
    EcatResetStatistics,
    EcatStartHotconnect,
)

from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.ethercat_conversions import fill_network_state
from robotd.ros.nodes.object_services import ObjectServices
from robotd.ros.services import add_service


class WmxEthercatNode(Node):
    """Services of diagnostics and of objects; they run in workers."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__("wmx_ethercat_node", context=host.context)
        self._fieldbus = robot.fieldbus
        for service_type, name, handler in (
            (EcatGetNetworkState, "get_network_state", self._get_network_state),
            (EcatRegisterRead, "register_read", self._register_read),
            (EcatResetStatistics, "reset_statistics", self._reset_statistics),
            (EcatStartHotconnect, "start_hotconnect", self._start_hot_connect),
        ):
            add_service(self, host, service_type, f"wmx/ecat/{name}", handler)
        self._objects = ObjectServices(self, host, robot.fieldbus)

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
