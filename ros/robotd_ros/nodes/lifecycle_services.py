"""Services and topic of a managed node, as ``ros2 lifecycle`` and managers use them."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from lifecycle_msgs import msg
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.node import Node

from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.lifecycle_table import GRAPH, State, Transition, available
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.robot_lifecycle import RobotLifecycle
from robotd_ros.services import add_service

log = get_logger("lifecycle")

EVENT_DEPTH = 10


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
    response.available_states = [_state(state) for state in State]


def _get_graph(request: Any, response: Any) -> None:
    response.available_transitions = _descriptions(GRAPH)


def _descriptions(transitions: Iterable[Transition]) -> list[Any]:
    return [
        msg.TransitionDescription(
            transition=msg.Transition(id=each.id, label=each.label),
            start_state=_state(each.start),
            goal_state=_state(each.goal),
        )
        for each in transitions
    ]


def _state(state: State) -> Any:
    return msg.State(id=state.value, label=state.label)
