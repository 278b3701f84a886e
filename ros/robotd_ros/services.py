"""Services and subscriptions whose handlers may block and may raise.

A handler is a plain function. rclpy would run it in the executor thread, where one that waits for
the hardware delays every other callback, and where an exception leaves the client without an
answer. Coroutine handlers are no way out: the EventsExecutor does not await them. So the callback
given to rclpy only hands the request on, and a worker sends the response when it has one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.service import Service
from rclpy.subscription import Subscription

from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd_ros.failed_requests import deferred, rejection
from robotd_ros.host import RosHost
from robotd_ros.middleware import NewestItems, RateLimit, ServiceResponses, with_message_info
from robotd_ros.qos import SERVICE

log = get_logger("ros")

HANDLER_SHARE = 0.2  # a move takes 0.2 ms: 1000 messages a second
RETRY_S = 0.02  # of the newest messages beyond the rate limit

ServiceHandler = Callable[[Any, Any], str | None]
Targets = frozenset[int]
WHOLE: Targets = frozenset({0})  # what a message commands, of a topic where that is always the same


def add_service(
    node: Node,
    host: RosHost,
    service_type: Any,
    name: str,
    handler: ServiceHandler,
    *,
    blocking: bool = True,
    urgent: bool | Callable[[Any], bool] = False,
    on_arrival: Callable[[Any], Any] = lambda request: request,
) -> Service:
    """Create a service that always answers.

    Args:
        node: its owner; any thread may create before ``host.add_node``.
        host: whose workers run blocking handlers.
        service_type: class of the service; ``success`` and ``message`` of its response are used
            for errors where it has them.
        name: as for ``Node.create_service``.
        handler: ``handler(request, response)`` fills the response; a text that it returns is the
            message of a success. A RobotdError becomes ``success=False`` with its text; anything
            else is logged with its traceback and answered ``internal error: ...``.
        blocking: True runs the handler in a worker, several at a time, so it guards what it
            shares; False runs it in the executor thread, for handlers that only read memory.
        urgent: a blocking handler that must not wait behind others, such as a stop; or which of
            its requests must not.
        on_arrival: called in the executor thread with each request, in the order of all that
            arrive; what it returns is handed to a blocking handler as the request.
    """
    service = node.create_service(service_type, name, deferred, qos_profile=SERVICE)
    responses = ServiceResponses(node, service)

    def answer(request: Any, header: Any) -> None:
        with host.sent_by_request(header):
            responses.send(respond(request, header), header)

    def respond(request: Any, header: Any) -> Any:
        """Return the handler's response, or a rejection for its exception."""
        response = service_type.Response()
        try:
            text = handler(request, response)
        except Exception as error:  # noqa: BLE001 - logged and answered
            host.request_log.rejected(header, "service rejected", error, service=name)
            return rejection(service_type, request, error)
        if isinstance(text, str):
            response.success, response.message = True, text
        return response

    def on_request(request: Any, header: Any) -> None:
        with host.callback_guard():
            if not blocking:
                responses.send(respond(request, header), header)
                return
            try:
                comes_first = urgent(request) if callable(urgent) else urgent
                host.submit(answer, on_arrival(request), header, urgent=comes_first)
            except RobotdError as error:
                host.request_log.rejected(header, "service rejected", error, service=name)
                responses.send(rejection(service_type, request, error), header)

    responses.defer(on_request)
    return service


def add_subscription(
    node: Node,
    host: RosHost,
    message_type: Any,
    topic: str,
    handler: Callable[[Any], None],
    qos: QoSProfile | int,
) -> Subscription:
    """Create a subscription whose handler may raise; it runs in the executor thread.

    For topics that move nothing; see ``add_command_subscription`` for the others.
    """
    return add_informed_subscription(
        node, host, message_type, topic, lambda message, _: handler(message), qos
    )


def add_informed_subscription(
    node: Node,
    host: RosHost,
    message_type: Any,
    topic: str,
    handler: Callable[[Any, Mapping[str, Any]], None],
    qos: QoSProfile | int,
    share: float = HANDLER_SHARE,
    targets: Callable[[bytes], Targets] = lambda data: WHOLE,
) -> Subscription:
    """Add a subscription with ``handler(message, info)``.

    ``info`` has ``source_timestamp``, the time at which the message was published, by the clock of
    that computer and since the epoch, 0 where the middleware does not know it, and
    ``publication_sequence_number``, its number among those of its publisher, None likewise.

    An exception that reaches the EventsExecutor also costs it the messages that arrived together
    with the offending one. Here it is logged and the next message is handled. That executor keeps
    an event for each message, so one that it cannot follow would answer services later and later:
    a handler gets ``share`` of the time. More messages are dropped undecoded, except the newest
    message for each of ``targets``, which may be the one that stops: it is handled when the limit
    allows. ``targets`` returns what a serialized message commands, the same few numbers in all.
    """
    rate_limit = RateLimit(share)
    waiting = NewestItems[tuple[bytes, Mapping[str, Any]]]()

    def on_message(data: bytes, info: Mapping[str, Any]) -> None:
        waiting.put(targets(data), (data, info))
        handle()

    def handle() -> None:
        with host.callback_guard():
            while waiting and rate_limit.is_left():
                execute(*waiting.pop())
            if not waiting:
                timer.cancel()
            elif timer.is_canceled():
                timer.reset()
            if waiting and rate_limit.is_news:
                log.warning("messages exceed the rate limit, some are dropped", topic=topic)

    def execute(data: bytes, info: Mapping[str, Any]) -> None:
        try:
            with rate_limit.spent(), host.sent_by_topic(subscription.topic_name):
                handler(deserialize_message(data, message_type), info)
        except Exception as error:  # noqa: BLE001 - logged
            host.request_log.rejected(None, "message rejected", error, topic=topic)

    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = node.create_timer(RETRY_S, handle, clock=steady, autostart=False)
    subscription = node.create_subscription(
        message_type, topic, with_message_info(on_message), qos, raw=True
    )
    return subscription
