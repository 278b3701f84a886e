"""Nodes of a robot in this process, for ``serve`` and for other programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from rclpy.node import Node

from robotd.plugin.registry import NodeRegistry
from robotd.robot import Robot
from robotd_page.page_topics import PageTopics
from robotd_ros.diagnostics.diagnostics_publisher import Diagnostics
from robotd_ros.host import RosHost
from robotd_ros.middleware import check_overrides
from robotd_ros.node_registry import OPERATOR_NODE, SIMULATION_NODE, make_node
from robotd_ros.nodes.operator_node import OperatorNode
from robotd_ros.nodes.rosout_topic import RosoutTopic
from robotd_ros.plugin import BUILT_IN, built_in_nodes
from robotd_ros.senders import Senders

if TYPE_CHECKING:
    from robotd_recorder.recorder import Recorder
    from robotd_scenario import FaultSchedule


@contextmanager
def run_nodes(
    robot: Robot,
    names: Sequence[str],
    host: RosHost,
    registry: NodeRegistry | None = None,
    faults: FaultSchedule | None = None,
    recorder: Recorder | None = None,
) -> Iterator[list[Node]]:
    """Serve the nodes of a robot that is not started; they end with the host.

    Args:
        robot, names, registry: as for ``serve``.
        host: started.
        faults: of a simulation; with it there is the node ``robotd_sim``.
        recorder: with it the node ``robotd`` has its services, and the topics of a remote page.

    Raises:
        DescriptorError, PluginError: a node or a parameter is wrong.
    """
    host.yield_to_control_loop = robot.control_loop.yield_to_control_loop
    # No client could stop it by ROS any more.
    host.on_hang = lambda reason: robot.servos.bring_to_rest()
    registry = registry or built_in_nodes()
    chosen = registry.select(names)
    nodes = [make_node(name, info, robot, host) for name, info in chosen.items()]
    operator = OperatorNode(robot, host, recorder)
    nodes.append(operator)
    host.senders = Senders(operator)
    if faults is not None:
        from robotd_scenario.simulation_node import SimulationNode

        nodes.append(SimulationNode(robot, host, nodes, faults))
    added = {OPERATOR_NODE, SIMULATION_NODE}
    check_overrides(nodes, {*BUILT_IN, *added}, {*registry.nodes, *added}, host.args)
    for node in nodes:
        host.add_node(node)
    with ExitStack() as stack:
        stack.enter_context(RosoutTopic(operator))
        stack.enter_context(Diagnostics(nodes, robot))
        if recorder is not None:
            stack.enter_context(PageTopics(operator, recorder.tap, [*chosen]))
        yield nodes
