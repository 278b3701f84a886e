"""ROS nodes by name: properties and construction. Imports ROS only to make a node."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from traceback import walk_tb
from typing import TYPE_CHECKING, Any

from robotd.errors import DescriptorError, PluginError, RobotdError, unknown_name
from robotd.plugin.registry import NodeInfo, NodeRegistry

if TYPE_CHECKING:
    from robotd.robot import Robot
    from robotd_ros.host import RosHost


BUILT_IN = {
    "wmx_engine_node": NodeInfo(
        "robotd_ros.nodes.wmx_engine_node:WmxEngineNode",
        "engine: open, communicate, state, ready",
        keeps_failed_start=True,
    ),
    "wmx_core_motion_node": NodeInfo(
        "robotd_ros.nodes.wmx_core_motion_node:WmxCoreMotionNode",
        "axes: servo, alarm, mode, homing, moves, velocity, state",
    ),
    "wmx_io_node": NodeInfo("robotd_ros.nodes.wmx_io_node:WmxIoNode", "digital inputs and outputs"),
    "wmx_ethercat_node": NodeInfo(
        "robotd_ros.nodes.wmx_ethercat_node:WmxEthercatNode",
        "fieldbus state, registers, statistics, objects",
    ),
    "manipulator_state": NodeInfo(
        "robotd_ros.nodes.manipulator_state:ManipulatorState",
        "joint states; the joints are switched on at start",
        enables_servos=True,
    ),
    "follow_joint_trajectory_server": NodeInfo(
        "robotd_ros.nodes.follow_joint_trajectory_server:FollowJointTrajectoryServer",
        "trajectories and the gripper",
    ),
    "joint_command_node": NodeInfo(
        "robotd_ros.nodes.joint_command_node:JointCommandNode",
        "motion on topics: trajectories, points, positions, velocities, jog",
    ),
    "gripper_controller": NodeInfo(
        "robotd_ros.nodes.gripper_controller:GripperController",
        "the gripper as actions, for MoveIt",
    ),
    "robot_state_publisher": NodeInfo(
        "robotd_ros.nodes.robot_state_publisher:RobotStatePublisher",
        "transforms of the whole robot from its URDF; replaces the program of this name",
    ),
    "diff_drive_controller": NodeInfo(
        "robotd_ros.nodes.base_controller:DiffDriveController",
        "twists and odometry of a mobile base; the wheels are switched on at start",
        enables_servos=True,
    ),
    "mecanum_drive_controller": NodeInfo(
        "robotd_ros.nodes.base_controller:MecanumDriveController",
        "twists and odometry of a mecanum base; the wheels are switched on at start",
        enables_servos=True,
    ),
    "tricycle_controller": NodeInfo(
        "robotd_ros.nodes.base_controller:TricycleController",
        "twists and odometry of a base with a steered wheel; both axes are switched on at start",
        enables_servos=True,
    ),
}


OPERATOR_NODE = "robotd"  # made beside the others of every robot
IDENTITY = f"{OPERATOR_NODE}/robot"  # std_msgs/String: which robot answers, as JSON
SIMULATION_NODE = "robotd_sim"  # made beside the others on a simulation that can fail


def known_nodes(registry: NodeRegistry | None = None) -> dict[str, NodeInfo]:
    """Built-in nodes and those of plugins, by name.

    Raises PluginError when a plugin takes the name of a built-in node.
    """
    plugins = registry.nodes if registry else {}
    for name in BUILT_IN.keys() & plugins.keys():
        factory = plugins[name].factory
        raise PluginError(f"node {name!r} of {factory} has the name of a built-in node")
    return BUILT_IN | plugins


def select_nodes(names: Iterable[str], registry: NodeRegistry | None = None) -> dict[str, NodeInfo]:
    """The nodes with these names, in this order.

    Raises DescriptorError, with the nearest name, for a node that does not exist.
    """
    known = known_nodes(registry)
    for name in names:
        if name not in known:
            raise DescriptorError(unknown_name("node", name, known), key="nodes")
    return {name: known[name] for name in names}


def make_node(name: str, info: NodeInfo, robot: Robot, host: RosHost) -> Any:  # an rclpy.node.Node
    """Import and make one node; nothing is opened and nothing moves.

    Raises:
        DescriptorError: a parameter is wrong.
        PluginError: the factory cannot be imported or fails.
    """
    from rclpy._rclpy_pybind11 import RCLError

    module, _, attribute = info.factory.partition(":")
    try:
        return getattr(import_module(module), attribute)(robot, host)
    except RobotdError:
        raise
    except RCLError as error:
        raise _endpoint_error(name, error) from error
    except Exception as error:
        if name in BUILT_IN:
            raise
        raise PluginError(
            f"node {name!r} ({info.factory}) cannot be made: {type(error).__name__}: {error}"
        ) from error


def _endpoint_error(name: str, error: Exception) -> DescriptorError:
    """Name the topic that rclpy did not create; its text names none, or no reason."""
    for frame, _ in walk_tb(error.__traceback__):
        values = frame.f_locals
        if frame.f_code.co_name in ("create_publisher", "create_subscription"):
            kind, topic = values["msg_type"], values["topic"]
            what = f"{topic!r} cannot be a topic of type {kind.__name__}"
            advice = "another topic of this robot has the name; choose another one"
            return DescriptorError(f"{what}: {advice}", key=name)
    return DescriptorError(str(error), key=name)
