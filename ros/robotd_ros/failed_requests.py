"""Answers to requests for which the callback of a service raises.

rclpy sends none then, and the client waits for ever. That concerns services of plugins and the
parameter services of every node: a value of an undefined type, which is a byte of a message, raises
in rclpy before any callback of the node.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.service import Service

from robotd.errors import InvalidArgument, RobotdError
from robotd.log import shortened
from robotd_ros.request_log import RequestLog

MAX_ANSWER_CHARACTERS = 8000  # of a reason; the errors of a file list up to 50 problems

Callback = Callable[[Any, Any], Any]


def deferred(request: Any, response: Any) -> Any:
    """Callback of a service whose response is sent later; see ``ServiceResponses.defer``."""
    return request


def answer_always(node: Node, request_log: RequestLog) -> None:
    """Let the services that ``node`` has answer where their callback raises."""
    for service in node.services:
        if service.callback is not deferred:
            service.callback = _answering(service, request_log)


def _answering(service: Service, request_log: RequestLog) -> Callback:
    callback: Callback = service.callback
    service_type, name = service.srv_type, service.service_name

    def answer(request: Any, response: Any) -> Any:
        try:
            if service_type in (SetParameters, SetParametersAtomically):
                for parameter in request.parameters:
                    value_of(parameter)
            return callback(request, response)
        except Exception as error:  # noqa: BLE001 - logged and answered
            request_log.rejected(None, "service rejected", error, service=name)
            return rejection(service_type, request, error)

    def answer_for_each(request: Any, response: Any) -> Any:
        """Set each parameter by itself: some may be rejected."""
        for parameter in request.parameters:
            part = SetParameters.Request(parameters=[parameter])
            response.results += answer(part, SetParameters.Response()).results
        return response

    return answer_for_each if service_type is SetParameters else answer


def value_of(parameter: Any) -> Any:
    """Return the value in a message. Raises InvalidArgument: its type is undefined."""
    try:
        return parameter_value_to_python(parameter.value)
    except RuntimeError as error:
        undefined = f"{parameter.name}: {parameter.value.type} is not a type of a parameter"
        raise InvalidArgument(undefined) from error


def rejection(service_type: Any, request: Any, error: Exception) -> Any:
    """Return a response that gives ``error`` as the reason, where its type has a field for it."""
    text = shortened(str(error), MAX_ANSWER_CHARACTERS)
    message = text if isinstance(error, RobotdError) else f"internal error: {text}"
    response = service_type.Response()
    if hasattr(response, "success"):
        response.success = False
    if hasattr(response, "message"):
        response.message = message
    elif service_type is SetParametersAtomically:
        response.result.reason = message
    elif service_type is SetParameters:
        response.results = [SetParametersResult(reason=message) for _ in request.parameters]
    return response
