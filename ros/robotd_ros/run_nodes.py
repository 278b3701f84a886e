"""Nodes of a robot in this process, for ``serve`` and for other programs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Any

from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node

from robotd.cli.start_summary import ServeReport, Topic
from robotd.feature import feature_errors, installed_features
from robotd.plugin.registry import NodeRegistry
from robotd.robot import Robot
from robotd_ros.diagnostics.diagnostics_publisher import Diagnostics
from robotd_ros.host import RosHost
from robotd_ros.middleware import check_overrides
from robotd_ros.node_factory import make_node
from robotd_ros.node_names import OPERATOR_NODE, WORLD_NODE
from robotd_ros.nodes.latched_topics import RosoutTopic
from robotd_ros.nodes.operator_node import OperatorNode
from robotd_ros.nodes.world_node import WorldNode
from robotd_ros.plugin import BUILT_IN, built_in_nodes
from robotd_ros.senders import Senders

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


@dataclass(frozen=True)
class NodeContext:
    """Argument of a feature that adds nodes, services or topics. Main thread.

    Attributes:
        robot: not started.
        host: serves the nodes.
        operator: node ``robotd``, which services and topics of a feature belong to.
        nodes: all nodes so far.
        node_names: of the robot's nodes.
    """

    robot: Robot
    host: RosHost
    operator: Node
    nodes: Sequence[Node]
    node_names: Sequence[str]


@contextmanager
def run_nodes(
    robot: Robot,
    names: Sequence[str],
    host: RosHost,
    registry: NodeRegistry | None = None,
    parts: Mapping[str, Any] | None = None,
) -> Iterator[list[Node]]:
    """Serve the nodes of a robot that is not started; they end with the host.

    Args:
        robot, names, registry: as for ``serve``; the nodes of the backend are served, too.
        host: started.
        parts: running features by name, see ``FeatureHost``; None: none.

    Raises DescriptorError, PluginError: a node or a parameter is wrong.
    """
    host.yield_to_control_loop = robot.control_loop.yield_to_control_loop
    # No client could stop it by ROS any more.
    host.on_hang = lambda reason: robot.servos.bring_to_rest()
    registry = served_nodes(robot, registry)
    chosen = registry.select([*names, *robot.backend.nodes.nodes])
    nodes = [make_node(name, info, robot, host) for name, info in chosen.items()]
    parts = parts or {}
    operator = OperatorNode(robot, host, [*parts])
    host.on_rejection = operator.publish_rejection
    nodes.append(operator)
    if robot.world is not None:
        nodes.append(WorldNode(robot, robot.world, host))
    host.senders = Senders(operator)
    with ExitStack() as stack:
        for name, feature in installed_features().items():
            if feature.nodes and (part := parts.get(name)) is not None:
                context = NodeContext(robot, host, operator, nodes, [*chosen])
                with feature_errors(name, "nodes"):
                    added = stack.enter_context(resolve_name(feature.nodes)(context, part)) or []
                    if wrong := [
                        added_node for added_node in added if not isinstance(added_node, Node)
                    ]:
                        raise TypeError(f"gave {type(wrong[0]).__name__}, not a Node")
                nodes += added
        own = own_nodes()
        check_overrides(nodes, {*BUILT_IN, *own}, {*registry.nodes, *own}, host.args)
        for node in nodes:
            host.add_node(node)
        stack.enter_context(RosoutTopic(operator))
        stack.enter_context(Diagnostics(nodes, robot, operator))
        yield nodes


def served_nodes(robot: Robot, registry: NodeRegistry | None = None) -> NodeRegistry:
    """Return ``registry`` (None: the built-in nodes) with the nodes of the robot's backend.

    Raises PluginError: two nodes have one name.
    """
    return (registry or built_in_nodes()).with_backend(robot.backend.nodes)


def own_nodes() -> set[str]:
    """Return the names of nodes that are made besides those of the robot."""
    features = (feature.node_names for feature in installed_features().values())
    return {OPERATOR_NODE, WORLD_NODE}.union(*features)


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
