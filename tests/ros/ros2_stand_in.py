"""Stand-in of the program ``ros2``, which the test environment does not have: rclpy does the calls.

    python -m tests.ros.ros2_stand_in topic pub -w 1 -r 20 TOPIC TYPE VALUES
    python -m tests.ros.ros2_stand_in topic echo TOPIC
    python -m tests.ros.ros2_stand_in service call SERVICE TYPE VALUES
    python -m tests.ros.ros2_stand_in param set NODE NAME VALUE

It sends the same messages over DDS. It does not model what ``ros2`` prints nor its daemon, and ends
where a reader would press Ctrl-C: ``topic pub -r`` after a second, ``topic echo`` after a message.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import rclpy
import yaml
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

WAIT_S = 60.0
PUBLISHED_S = 1.0


def interface(name: str) -> Any:
    """The class of ``package/msg/Name``."""
    package, kind, word = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), word)


def fill(message: Any, values: dict[str, Any]) -> Any:
    """Set the fields of a message; an unknown one raises AttributeError, as in ``ros2``."""
    types = message.get_fields_and_field_types()
    for name, value in values.items():
        if name not in types:
            raise AttributeError(f"{type(message).__name__} has no field {name!r}")
        old = getattr(message, name)
        is_message = hasattr(old, "get_fields_and_field_types")
        setattr(message, name, fill(old, value) if is_message else type(old)(value))
    return message


def wait(node: Node, condition: Callable[[], Any], what: str) -> Any:
    deadline_s = time.monotonic() + WAIT_S
    while not (answer := condition()):
        if time.monotonic() > deadline_s:
            sys.exit(f"timeout: {what}")
        rclpy.spin_once(node, timeout_sec=0.02)
    return answer


def call(node: Node, service: str, kind: Any, request: Any) -> Any:
    client = node.create_client(kind, service)
    wait(node, client.service_is_ready, f"service {service}")
    future = client.call_async(request)
    return wait(node, future.done, f"answer of {service}") and future.result()


def publish(node: Node, words: list[str]) -> str:
    matches, rate_hz = 0, 0.0
    while words[0].startswith("-"):
        option, value, *words = words
        match option:
            case "-w":
                matches = int(value)
            case "-r":
                rate_hz = float(value)
            case _:
                sys.exit(f"the stand-in does not know {option}")
    topic, kind, values = words
    message = fill(interface(kind)(), yaml.safe_load(values))
    publisher = node.create_publisher(type(message), topic, 10)
    wait(node, lambda: publisher.get_subscription_count() >= matches, f"subscribers of {topic}")
    for _ in range(round(rate_hz * PUBLISHED_S) or 1):
        publisher.publish(message)
        time.sleep(1.0 / rate_hz if rate_hz else 0.0)
    return f"published {topic}"


def echo(node: Node, topic: str) -> str:
    def kinds() -> list[str]:
        return dict(node.get_topic_names_and_types()).get(topic, [])

    received: list[Any] = []
    kind = interface(wait(node, kinds, f"topic {topic}")[0])
    node.create_subscription(kind, topic, received.append, 10)
    wait(node, lambda: received, f"message on {topic}")
    return str(received[0])


def set_parameter(node: Node, owner: str, name: str, text: str) -> str:
    parameters = [Parameter(name, value=yaml.safe_load(text)).to_parameter_msg()]
    request = SetParameters.Request(parameters=parameters)
    result = call(node, f"{owner}/set_parameters", SetParameters, request).results[0]
    return "set" if result.successful else sys.exit(result.reason)


def main(words: list[str]) -> str:
    rclpy.init()
    node = rclpy.create_node("ros2_stand_in")
    match words:
        case ["topic", "pub", *rest]:
            return publish(node, rest)
        case ["topic", "echo", topic]:
            return echo(node, topic)
        case ["service", "call", service, kind, values]:
            request = fill(interface(kind).Request(), yaml.safe_load(values))
            response = call(node, service, interface(kind), request)
            return str(response) if getattr(response, "success", True) else sys.exit(str(response))
        case ["param", "set", owner, name, text]:
            return set_parameter(node, owner, name, text)
    return sys.exit(f"the stand-in does not know: ros2 {' '.join(words)}")


if __name__ == "__main__":
    sys.stdout.write(f"{main(sys.argv[1:])}\n")
