"""Topics, services and actions of a set of nodes, from the ROS graph."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node

from robotd.cli.start_summary import ServeReport, Topic

# Every node has these.
_COMMON_TOPICS = ("/rosout", "/parameter_events", "/clock")
_COMMON_SERVICES = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "get_type_description",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
)


def report_of(nodes: Iterable[Node]) -> ServeReport:
    """Return everything that ``nodes`` publish, subscribe and serve.

    A node may state the rates of its topics as ``rates_hz``, a mapping of resolved names.
    """
    names, topics, services, actions = [], {}, set(), set()
    for node in nodes:
        own = (node.get_name(), node.get_namespace())
        names.append(node.get_fully_qualified_name())
        rates = getattr(node, "rates_hz", {})
        for listing in (
            node.get_publisher_names_and_types_by_node(*own),
            node.get_subscriber_names_and_types_by_node(*own),
        ):
            for name, types in listing:
                if name not in _COMMON_TOPICS and "/_action/" not in name:
                    topics[name] = Topic(name, types[0], rates.get(name))
        for name, _ in node.get_service_names_and_types_by_node(*own):
            own_name = name.removeprefix(f"{names[-1]}/")
            if own_name not in _COMMON_SERVICES and "/_action/" not in name:
                services.add(name)
        actions |= {name for name, _ in get_action_server_names_and_types_by_node(node, *own)}
    return ServeReport(
        tuple(names),
        tuple(topics[name] for name in sorted(topics)),
        tuple(sorted(services)),
        tuple(sorted(actions)),
    )
