"""The names of the ROS nodes, and how a node is made from its name. Imports no ROS by itself."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING, Any

from robotd.errors import DescriptorError, PluginError, RobotdError
from robotd.plugin.registry import NodeRegistry

if TYPE_CHECKING:
    from robotd.robot import Robot
    from robotd.ros.host import RosHost


@dataclass(frozen=True)
class NodeInfo:
    """A node that a descriptor can name.

    Attributes:
        factory: ``package.module:name`` of what makes it, called as ``factory(robot, host)``
            and returning an ``rclpy.node.Node`` that the host is going to serve and destroy.
        summary: one line for people.
    """

    factory: str
    summary: str


BUILT_IN = {
    "wmx_engine_node": NodeInfo(
        "robotd.ros.nodes.wmx_engine_node:WmxEngineNode", "engine: open, communicate, state, ready"
    ),
    "wmx_core_motion_node": NodeInfo(
        "robotd.ros.nodes.wmx_core_motion_node:WmxCoreMotionNode",
        "axes: servo, alarm, mode, homing, moves, velocity, state",
    ),
    "wmx_io_node": NodeInfo("robotd.ros.nodes.wmx_io_node:WmxIoNode", "digital inputs and outputs"),
    "wmx_ethercat_node": NodeInfo(
        "robotd.ros.nodes.wmx_ethercat_node:WmxEthercatNode",
        "fieldbus state, registers, statistics",
    ),
    "manipulator_state": NodeInfo(
        "robotd.ros.nodes.manipulator_state:ManipulatorState",
        "joint states; the joints are switched on at start",
    ),
    "follow_joint_trajectory_server": NodeInfo(
        "robotd.ros.nodes.follow_joint_trajectory_server:FollowJointTrajectoryServer",
        "trajectories and the gripper",
    ),
    "diff_drive_controller": NodeInfo(
        "robotd.ros.nodes.diff_drive_controller:DiffDriveController",
        "twists and odometry of a mobile base; the wheels are switched on at start",
    ),
}


SIMULATION_NODE = "robotd_sim"  # made beside the others on a simulation that can fail

# The ones whose presence switches the servos on.
ENABLING_NODES = frozenset({"manipulator_state", "diff_drive_controller"})


def known_nodes(registry: NodeRegistry | None = None) -> dict[str, NodeInfo]:
    """Built-in nodes and those of plugins, by name.

    Raises PluginError when a plugin takes the name of a built-in node.
    """
    nodes = dict(BUILT_IN)
    for name, factory in (registry.factories if registry else {}).items():
        if name in nodes:
            raise PluginError(f"node {name!r} of {factory} has the name of a built-in node")
        nodes[name] = NodeInfo(factory, f"by {factory.partition(':')[0]}")
    return nodes


def check_names(names: Iterable[str], registry: NodeRegistry | None = None) -> None:
    """Raise DescriptorError, with the nearest name, for a node that does not exist."""
    known = known_nodes(registry)
    for name in names:
        if name not in known:
            near = get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
            raise DescriptorError(f"no node is named {name!r}; {hint}", key="nodes")


def make_node(
    name: str, robot: Robot, host: RosHost, registry: NodeRegistry | None = None
) -> Any:  # an rclpy.node.Node
    """Import and make one node; nothing is opened and nothing moves.

    Raises:
        DescriptorError: the name is not known, or a parameter is wrong.
        PluginError: the factory cannot be imported or fails.
    """
    check_names([name], registry)
    factory = known_nodes(registry)[name].factory
    module, _, attribute = factory.partition(":")
    try:
        return getattr(import_module(module), attribute)(robot, host)
    except RobotdError:
        raise
    except Exception as error:
        if name in BUILT_IN:
            raise
        raise PluginError(
            f"node {name!r} ({factory}) cannot be made: {type(error).__name__}: {error}"
        ) from error
