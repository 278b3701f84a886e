"""Client of a running robot, used by the commands of the command line.

It uses the names that the nodes have by default. A robot started with remaps or a namespace is
reached with the same ``--ros-args``. One thread; nothing here is meant for a control loop.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any, Self

import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool, Trigger

from robotd.errors import DeviceTimeout, OperationError
from robotd.log import escaped
from robotd_ros.middleware import (
    discovery_server,
    log_file_arguments,
    see_whole_graph,
    use_profiles,
)
from robotd_ros.node_names import OPERATOR_NODE

MAY_HAVE_ACTED = "the robot may have done it, and the answer was lost or is late; robotd status"
_TICK_S = 0.02  # the longest that a signal or a newly discovered process waits


class Discovery:
    """Time since a node has discovered something new.

    On a busy computer, and of many robots, it finds one after the other, nodes before their topics.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._known = node, (0, 0)
        self._changed_s = self._looked_s = time.monotonic()

    def quiet_s(self) -> float:
        """Return for how long no node or topic has come or gone; to be called again and again."""
        now_s = time.monotonic()
        if now_s - self._looked_s > _TICK_S:  # not at every event: a large graph takes a while
            self._looked_s = now_s
            found = len(self._node.get_node_names()), len(self._node.get_topic_names_and_types())
            if found != self._known:
                self._changed_s, self._known = now_s, found
        return now_s - self._changed_s


class RosClient:
    """ROS node that calls services and waits for messages, from ``start`` to ``close``.

    Signal handlers are left alone: Ctrl-C raises KeyboardInterrupt out of a wait.

    Args:
        ros_args: command line from ``--ros-args`` on.
        timeout_s: how long an answer may take, discovery included; seconds.
        searches: the client looks for names that it does not know beforehand.

    Attributes:
        node: for publishers, subscriptions and action clients; driven by ``wait`` only.
        before_request: called once, before the next request and when its service is discovered;
            what it raises is raised instead.
    """

    node: Node
    before_request: Callable[[], object] | None = None

    def __init__(
        self, ros_args: Sequence[str] = (), timeout_s: float = 5.0, *, searches: bool = False
    ) -> None:
        self.timeout_s = timeout_s
        self._searches = searches
        self._ros_args = list(ros_args)
        self._context = Context()

    def start(self) -> None:
        """Raises OperationError: the ROS arguments are wrong or the middleware does not start."""
        use_profiles()
        if self._searches:
            see_whole_graph()
        try:
            rclpy.init(
                args=[*log_file_arguments()[0], *self._ros_args],
                context=self._context,
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except Exception as error:
            raise OperationError(f"ROS does not start: {error}") from error
        self.node = Node(
            f"robotd_client_{os.getpid()}",
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
            # It needs NumPy, which takes longer to import than a robot to stop.
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def close(self) -> None:
        """Destroy the node and shut ROS down."""
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def wait(
        self,
        condition: Callable[[], Any],
        what: str,
        timeout_s: float | None = None,
        *,
        hint: str = "",
    ) -> Any:
        """Return the first true result of ``condition``, called after every event.

        Args:
            condition: must not block.
            what: named in the error where the robot runs: "no {what} within ...".
            timeout_s: seconds; None takes the client's own.
            hint: end of the error; "" says whether the robot runs, and what to check.

        Raises DeviceTimeout: there was none in time.
        """
        timeout_s = self.timeout_s if timeout_s is None else timeout_s
        deadline = time.monotonic() + timeout_s
        while not (answer := condition()):
            if time.monotonic() > deadline:
                raise DeviceTimeout(self._missing(what, timeout_s, hint))
            self.spin()
        return answer

    def settle(self, quiet_s: float, handle: Callable[[], None] | None = None) -> bool:
        """Wait until discovery finds nothing new for ``quiet_s``; False: not within the time-out.

        ``handle`` handles the next event; None: ``spin``.
        """
        discovery = Discovery(self.node)
        deadline_s = time.monotonic() + self.timeout_s
        while discovery.quiet_s() < quiet_s:
            if time.monotonic() > deadline_s:
                return False
            (handle or self.spin)()
        return True

    def spin(self) -> None:
        """Handle the next event, or wait 20 ms for one."""
        self._executor.spin_once(timeout_sec=_TICK_S)

    def call(self, service_type: Any, name: str, /, **request: Any) -> Any:
        """The response of service ``name``; the request's fields by name.

        Raises:
            DeviceTimeout: there is no such service, or it does not answer in time.
            OperationError: the response says ``success=False``; its reason is the text.
        """
        client = self.node.create_client(service_type, name)
        try:
            self.wait(client.service_is_ready, f"service {client.service_name}")
            if (check := self.before_request) is not None:
                self.before_request = None
                check()
            future = client.call_async(service_type.Request(**request))
            self.wait(future.done, f"answer from {client.service_name}", hint=MAY_HAVE_ACTED)
        finally:
            self.node.destroy_client(client)
        response = future.result()
        escape_texts(response)
        if not getattr(response, "success", True):
            raise OperationError(response.message)
        return response

    def trigger(self, name: str) -> str:
        """Call a Trigger service; return its message. Raises the errors of ``call``."""
        return str(self.call(Trigger, name).message)

    def switch(self, name: str, on: bool) -> str:
        """Call a SetBool service; return its message. Raises the errors of ``call``."""
        return str(self.call(SetBool, name, data=on).message)

    def parameters(self, node: str, names: Sequence[str]) -> list[Any]:
        """Return the values of parameters of ``node``, None for one that is not set.

        Empty where the node has not declared all of them. Raises the errors of ``call``.
        """
        response = self.call(GetParameters, f"{node}/get_parameters", names=names)
        return list(map(parameter_value_to_python, response.values))

    def listen(self, message_type: Any, topic: str, qos: Any = 1) -> Listener:
        """Subscribe ``topic`` until the listener is closed."""
        return Listener(self, message_type, topic, qos)

    def _missing(self, what: str, timeout_s: float, hint: str) -> str:
        if hint or self.runs():
            hint = hint or "robotd is running, but without it or too busy to answer"
            if self.node.count_publishers("/clock"):
                hint += "; its time is simulated, and may be paused: robotd sim resume"
            return f"no {what} within {timeout_s:g} s: {hint}"
        return f"no robot found within {timeout_s:g} s, {self.where()}"

    def runs(self) -> bool:
        """Return True where a robot with the names of this client is seen."""
        return bool(self.node.count_services(f"{OPERATOR_NODE}/stop"))

    def where(self) -> str:
        """Return where a robot was looked for, and what to check."""
        domain = os.environ.get("ROS_DOMAIN_ID") or "0"
        server = f", ROS_DISCOVERY_SERVER={servers}" if (servers := discovery_server()) else ""
        return (
            f"with ROS_DOMAIN_ID={domain}{server} in namespace {self.node.get_namespace()}:"
            " is robotd running there? robotd list shows the robots of a domain"
        )


class Listener:
    """Subscription that keeps the newest message.

    Attributes:
        newest: None before the first message.
        newest_s: monotonic time at which it came; before the first, of the subscription.
    """

    def __init__(self, client: RosClient, message_type: Any, topic: str, qos: Any) -> None:
        self.newest: Any = None
        self.newest_s = time.monotonic()
        self._client = client
        self._subscription = client.node.create_subscription(message_type, topic, self._keep, qos)

    def wait(self) -> Any:
        """The newest message, the first one if there is none yet. Raises DeviceTimeout."""
        return self._client.wait(lambda: self.newest, f"message on {self._subscription.topic_name}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.node.destroy_subscription(self._subscription)

    def _keep(self, message: Any) -> None:
        escape_texts(message)
        self.newest, self.newest_s = message, time.monotonic()


def escape_texts(message: Any) -> None:
    """Escape control characters in all texts of ``message``: commands print them to a terminal."""
    for field in message.get_fields_and_field_types():
        value = getattr(message, field)
        if isinstance(value, str):
            setattr(message, field, escaped(value))
        elif isinstance(value, list) and value and isinstance(value[0], str):
            setattr(message, field, [escaped(item) for item in value])
        else:
            for item in value if isinstance(value, list) else [value]:
                if hasattr(item, "get_fields_and_field_types"):
                    escape_texts(item)
