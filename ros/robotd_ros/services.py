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
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.service import Service
from rclpy.subscription import Subscription

from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd_ros.host import RosHost
from robotd_ros.middleware import RateLimit, ServiceResponses, with_message_info
from robotd_ros.qos import SERVICE

log = get_logger("ros")

HANDLER_SHARE = 0.2  # a move takes 0.2 ms: 1000 messages a second
RETRY_S = 0.02  # of the newest message beyond the rate limit

ServiceHandler = Callable[[Any, Any], str | None]


def add_service(
    node: Node,
    host: RosHost,
    service_type: Any,
    name: str,
    handler: ServiceHandler,
    *,
    blocking: bool = True,
    urgent: bool = False,
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
        urgent: a blocking handler that must not wait behind others, such as a stop.
        on_arrival: called in the executor thread with each request, in the order of all that
            arrive; what it returns is handed to a blocking handler as the request.
    """
    service = node.create_service(
        service_type, name, lambda request, _: request, qos_profile=SERVICE
    )
    responses = ServiceResponses(node, service)

    def answer(request: Any, header: Any) -> None:
        with host.sent_by_request(header):
            response = _answer(service_type, name, handler, request)
        responses.send(response, header)

    def on_request(request: Any, header: Any) -> None:
        with host.callback_guard():
            if not blocking:
                responses.send(_answer(service_type, name, handler, request), header)
                return
            try:
                host.submit(answer, on_arrival(request), header, urgent=urgent)
            except RobotdError as error:
                responses.send(_rejection(service_type, name, str(error)), header)

    responses.defer(on_request)
    return service


def named_values(handle: Callable[[dict[str, Any]], str]) -> ServiceHandler:
    """Return a handler of SetParametersAtomically that calls ``handle`` with values by name.

    Its text becomes the reason of the response.
    """

    def answer(request: Any, response: Any) -> None:
        fields = {each.name: parameter_value_to_python(each.value) for each in request.parameters}
        response.result.reason, response.result.successful = handle(fields), True

    return answer


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
    return add_timed_subscription(
        node, host, message_type, topic, lambda message, _: handler(message), qos
    )


def add_timed_subscription(
    node: Node,
    host: RosHost,
    message_type: Any,
    topic: str,
    handler: Callable[[Any, int], None],
    qos: QoSProfile | int,
    share: float = HANDLER_SHARE,
) -> Subscription:
    """As ``add_subscription``, with ``handler(message, source_ns)``.

    ``source_ns`` is the time at which the message was published, by the clock of that computer
    and since the epoch; 0 where the middleware does not know it.

    An exception that reaches the EventsExecutor also costs it the messages that arrived together
    with the offending one. Here it is logged and the next message is handled. That executor keeps
    an event for each message, so one that it cannot follow would answer services later and later:
    a handler gets ``share`` of the time. What is beyond is dropped undecoded, except the newest
    message, which may be the one that stops: it is handled when the limit allows.
    """
    rate_limit = RateLimit(share)
    newest: tuple[bytes, int] | None = None  # message that is not handled yet

    def on_message(data: bytes, info: Mapping[str, Any]) -> None:
        nonlocal newest
        newest = data, info["source_timestamp"]
        handle_newest()

    def handle_newest() -> None:
        nonlocal newest
        with host.callback_guard():
            if newest is None:
                timer.cancel()
                return
            if not rate_limit.is_left():
                if rate_limit.is_news:
                    log.warning("messages exceed the rate limit, some are dropped", topic=topic)
                if timer.is_canceled():
                    timer.reset()
                return
            (data, source_ns), newest = newest, None
            try:
                with rate_limit.spent(), host.sent_by_topic(subscription.topic_name):
                    handler(deserialize_message(data, message_type), source_ns)
            except RobotdError as error:
                log.warning("message rejected", topic=topic, reason=str(error))
            except Exception:
                log.exception("message handler raised", topic=topic)

    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = node.create_timer(RETRY_S, handle_newest, clock=steady, autostart=False)
    subscription = node.create_subscription(
        message_type, topic, with_message_info(on_message), qos, raw=True
    )
    return subscription


def _answer(service_type: Any, name: str, handler: ServiceHandler, request: Any) -> Any:
    """Return the handler's response, or a rejection for its exception. Never raises."""
    response = service_type.Response()
    try:
        text = handler(request, response)
    except RobotdError as error:
        log.info("service rejected", service=name, reason=str(error))
        return _rejection(service_type, name, str(error))
    except Exception as error:
        log.exception("service handler raised", service=name)
        return _rejection(service_type, name, f"internal error: {error}")
    if isinstance(text, str):
        response.success, response.message = True, text
    return response


def _rejection(service_type: Any, name: str, message: str) -> Any:
    response = service_type.Response()
    if hasattr(response, "success"):
        response.success = False
    if hasattr(response, "message"):
        response.message = message
    elif hasattr(response, "result"):  # SetParametersAtomically, whose success is False
        response.result.reason = message
    else:
        log.error("the response has no field for this", service=name, reason=message)
    return response
