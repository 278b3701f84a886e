"""wmx_engine_node: services that open, start, stop and close the engine, and its state."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger
from wmx_ros2_message.srv import SetEngine

from robotd.device.state import ConnectionState
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.ready_topic import PERIOD_S, ReadyTopic
from robotd.ros.services import add_service

READY = "wmx/engine/ready"
_PACKAGES = {"SetBool": "std_srvs", "SetEngine": "wmx_ros2_message"}


class WmxEngineNode(Node):
    """Node that opens and closes the device, starts and stops communication, reports the state.

    Nothing here enables a servo: after a restart of the engine the axes wait for ``set_on``.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__("wmx_engine_node", context=host.context)
        self._connection = robot.connection
        add_service(self, host, SetEngine, "wmx/engine/set_device", self._set_device)
        add_service(self, host, SetBool, "wmx/engine/set_comm", self._set_communication)
        add_service(self, host, Trigger, "wmx/engine/get_status", self._get_status, blocking=False)
        add_service(self, host, Trigger, "wmx/engine/get_fault", self._get_fault)
        add_service(self, host, Trigger, "wmx/engine/scan_network", self._scan_network)
        self._ready = ReadyTopic(self, robot.connection, READY)
        self.rates_hz = {self.resolve_topic_name(READY): 1 / PERIOD_S}

    def _set_device(self, request: Any, response: Any) -> Any:
        if request.data:
            self._connection.open(request.path, request.name)
        else:
            self._connection.close()
        return self._done(response)

    def _set_communication(self, request: Any, response: Any) -> Any:
        if request.data:
            self._connection.start_communication()
        else:
            self._connection.stop_communication()
        return self._done(response)

    def _get_status(self, request: Any, response: Any) -> Any:
        return self._done(response)

    def _get_fault(self, request: Any, response: Any) -> Any:
        """Answer why axes cannot be commanded and what helps, a line each; empty when ready."""
        connection = self._connection
        reason = "; ".join(line.strip() for line in connection.rejection.splitlines())
        lines = [] if connection.commandable else [reason, self._remedy()]
        response.success = True
        response.message = "\n".join(filter(None, lines))
        return response

    def _remedy(self) -> str:
        """The commands that bring the device back; "" where waiting or nothing helps."""
        connection = self._connection
        if connection.ending or (connection.step.text and not connection.established):
            return ""
        calls = []
        if connection.state is ConnectionState.SHUTDOWN:
            calls.append(self._command("wmx/engine/set_device", "SetEngine", "false"))
        if connection.state in (ConnectionState.SHUTDOWN, ConnectionState.IDLE):
            calls.append(self._command("wmx/engine/set_device", "SetEngine", "true"))
        calls.append(self._command("wmx/engine/set_comm", "SetBool", "true"))
        return ", then ".join([*calls, "robotd servo on"])

    def _command(self, service: str, kind: str, data: str) -> str:
        name = self.resolve_service_name(service)
        return f"ros2 service call {name} {_PACKAGES[kind]}/srv/{kind} '{{data: {data}}}'"

    def _scan_network(self, request: Any, response: Any) -> Any:
        response.success = True
        response.message = self._connection.scan_network()
        return response

    def _done(self, response: Any) -> Any:
        """Fill the response with success and the present state."""
        response.success = True
        response.message = self._connection.state.value
        return response
