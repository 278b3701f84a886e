"""wmx_engine_node: services that open, start, stop and close the engine, and its state."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from lifecycle_msgs import msg
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger
from wmx_ros2_message.srv import SetEngine

from robotd.errors import NotReady, RobotdError
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.device_settings import read_engine
from robotd_ros.nodes.latched_topics import PERIOD_S, ReadyTopic, publish_if_alive
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.robot_lifecycle import GRAPH, LifecycleState, RobotLifecycle, Transition, available
from robotd_ros.services import add_service

READY = "wmx/engine/ready"
log = get_logger("lifecycle")

EVENT_DEPTH = 10


class WmxEngineNode(Node):
    """Node that opens and closes the device, starts and stops communication, reports the state.

    Nothing here enables a servo: after a restart of the engine the axes wait for ``set_on``. With
    the parameter ``managed`` a lifecycle manager starts and stops the robot, servos included.

    Attributes:
        lifecycle: None where the robot is not managed.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__("wmx_engine_node", context=host.context)
        self._robot, self._connection = robot, robot.connection
        managed = read_settings(self, robot.descriptor, read_engine)
        self.lifecycle = LifecycleServices(self, robot, host).lifecycle if managed else None
        for service_type, name, handler, blocking in (
            (SetEngine, "set_device", self._set_device, True),
            (SetBool, "set_comm", self._set_communication, True),
            (Trigger, "get_status", lambda *_: robot.connection.state.value, False),
            (Trigger, "get_fault", self._get_fault, True),
            (Trigger, "scan_network", lambda *_: robot.connection.scan_network(), True),
        ):
            add_service(self, host, service_type, f"wmx/engine/{name}", handler, blocking=blocking)
        self._ready = ReadyTopic(self, robot.connection, READY)
        self.rates_hz = {self.resolve_topic_name(READY): 1 / PERIOD_S}

    def _set_device(self, request: Any, response: Any) -> str:
        self._check_unmanaged()
        if request.data:
            self._connection.open(request.path, request.name)
        else:
            self._connection.close()
        return self._connection.state.value

    def _set_communication(self, request: Any, response: Any) -> str:
        self._check_unmanaged()
        if request.data:
            self._connection.start_communication()
        else:
            self._connection.stop_communication()
        return self._connection.state.value

    def _check_unmanaged(self) -> None:
        if self.lifecycle is not None:
            what = "a lifecycle manager starts and stops this robot"
            raise NotReady(f"{what}: use {self.get_fully_qualified_name()}/change_state")

    def _get_fault(self, request: Any, response: Any) -> str:
        """Answer why axes cannot be commanded and what helps, a line each; empty when ready."""
        if self._robot.axes.stop_latch.inactive:
            return self._robot.axes.stop_latch.rejection
        if self._connection.commandable:
            return ""
        found = self._robot.find_problems()
        return "\n".join(filter(None, (found[0].reason, found[0].remedy))) if found else ""


class LifecycleServices:
    """``~/change_state``, ``~/get_state`` and the others of a managed node.

    The response of ``~/change_state`` comes when the transition has ended; the log has the reason
    of a failure.

    Attributes:
        lifecycle: state machine that the services drive.
    """

    def __init__(self, node: Node, robot: Robot, host: RosHost) -> None:
        self._publisher = node.create_publisher(
            msg.TransitionEvent, "~/transition_event", EVENT_DEPTH
        )
        self.lifecycle = RobotLifecycle(robot, self._publish)
        add_service(node, host, ChangeState, "~/change_state", self._change)
        for service_type, name, handler in (
            (GetState, "get_state", self._get_state),
            (GetAvailableStates, "get_available_states", _get_states),
            (GetAvailableTransitions, "get_available_transitions", self._get_transitions),
            (GetAvailableTransitions, "get_transition_graph", _get_graph),
        ):
            add_service(node, host, service_type, f"~/{name}", handler, blocking=False)

    def _change(self, request: Any, response: Any) -> None:
        wanted = request.transition
        try:
            response.success = self.lifecycle.change(wanted.id, wanted.label)
        except RobotdError as error:  # the response has no field for it
            log.warning("transition rejected", reason=str(error))
            response.success = False

    def _get_state(self, request: Any, response: Any) -> None:
        response.current_state = _state(self.lifecycle.state)

    def _get_transitions(self, request: Any, response: Any) -> None:
        response.available_transitions = _descriptions(available(self.lifecycle.state))

    def _publish(self, transition: Transition) -> None:
        event = msg.TransitionEvent(
            timestamp=time.time_ns(),
            transition=msg.Transition(id=transition.id, label=transition.label),
            start_state=_state(transition.start),
            goal_state=_state(transition.goal),
        )
        publish_if_alive(self._publisher, event)


def _get_states(request: Any, response: Any) -> None:
    response.available_states = [_state(state) for state in LifecycleState]


def _get_graph(request: Any, response: Any) -> None:
    response.available_transitions = _descriptions(GRAPH)


def _descriptions(transitions: Iterable[Transition]) -> list[Any]:
    return [
        msg.TransitionDescription(
            transition=msg.Transition(id=transition.id, label=transition.label),
            start_state=_state(transition.start),
            goal_state=_state(transition.goal),
        )
        for transition in transitions
    ]


def _state(state: LifecycleState) -> Any:
    return msg.State(id=state.value, label=state.label)
