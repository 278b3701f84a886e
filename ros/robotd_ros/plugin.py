"""Registers the built-in ROS nodes, as a plugin does. Imports no ROS."""

from __future__ import annotations

from robotd.api import NodeRegistry, hookimpl
from robotd.plugin.registry import NodeInfo
from robotd_ros.node_names import OPERATOR_NODE, WORLD_NODE

BUILT_IN = {
    "wmx_engine_node": NodeInfo(
        "robotd_ros.nodes.wmx_engine_node:WmxEngineNode",
        "engine: open, communicate, state, ready",
        keeps_failed_start=True,
        parameters="robotd_ros.nodes.device_settings:read_engine",
    ),
    "wmx_core_motion_node": NodeInfo(
        "robotd_ros.nodes.wmx_core_motion_node:WmxCoreMotionNode",
        "axes: servo, alarm, mode, homing, moves, velocity, state",
        parameters="robotd_ros.nodes.device_settings:read_core_motion",
    ),
    "wmx_io_node": NodeInfo(
        "robotd_ros.nodes.wmx_io_node:WmxIoNode",
        "digital inputs and outputs",
        parameters="robotd.plugin.parameter_reader:no_parameters",
    ),
    "wmx_ethercat_node": NodeInfo(
        "robotd_ros.nodes.wmx_ethercat_node:WmxEthercatNode",
        "fieldbus state, registers, statistics, objects",
        parameters="robotd.plugin.parameter_reader:no_parameters",
    ),
    "manipulator_state": NodeInfo(
        "robotd_ros.nodes.manipulator_state:ManipulatorState",
        "joint states; the joints are switched on at start",
        enables_servos=True,
        parameters="robotd_ros.nodes.arm_settings:read_manipulator_state",
    ),
    "follow_joint_trajectory_server": NodeInfo(
        "robotd_ros.nodes.follow_joint_trajectory_server:FollowJointTrajectoryServer",
        "trajectories and the gripper",
        parameters="robotd_ros.nodes.arm_settings:read_trajectory_server",
    ),
    "joint_command_node": NodeInfo(
        "robotd_ros.nodes.joint_command_node:JointCommandNode",
        "motion on topics: trajectories, points, positions, velocities, jog",
        parameters="robotd_ros.nodes.arm_settings:read_joint_command",
    ),
    "gripper_controller": NodeInfo(
        "robotd_ros.nodes.gripper_controller:GripperController",
        "grippers as actions, for MoveIt",
        parameters="robotd_ros.nodes.arm_settings:read_gripper_controller",
    ),
    "robot_state_publisher": NodeInfo(
        "robotd_ros.nodes.robot_state_publisher:RobotStatePublisher",
        "transforms of the whole robot from its URDF; replaces the program of this name",
        parameters="robotd_ros.nodes.device_settings:read_state_publisher",
    ),
    "diff_drive_controller": NodeInfo(
        "robotd_ros.nodes.base_controller:DiffDriveController",
        "twists and odometry of a mobile base; the wheels are switched on at start",
        enables_servos=True,
        parameters="robotd_ros.nodes.base_settings:read_diff_drive",
    ),
    "mecanum_drive_controller": NodeInfo(
        "robotd_ros.nodes.base_controller:MecanumDriveController",
        "twists and odometry of a mecanum base; the wheels are switched on at start",
        enables_servos=True,
        parameters="robotd_ros.nodes.base_settings:read_mecanum_drive",
    ),
    "tricycle_controller": NodeInfo(
        "robotd_ros.nodes.base_controller:TricycleController",
        "twists and odometry of a base with a steered wheel; both axes are switched on at start",
        enables_servos=True,
        parameters="robotd_ros.nodes.base_settings:read_tricycle",
    ),
}


@hookimpl
def robotd_register_nodes(registry: NodeRegistry) -> None:
    """Add the built-in nodes, and what serves all nodes."""
    registry.serve_with("robotd_ros.serve:serve", (OPERATOR_NODE, WORLD_NODE))
    for name, info in BUILT_IN.items():
        registry.add(
            name,
            info.factory,
            summary=info.summary,
            enables_servos=info.enables_servos,
            keeps_failed_start=info.keeps_failed_start,
            parameters=info.parameters,
        )


def built_in_nodes() -> NodeRegistry:
    """Return a registry of the built-in nodes, for programs without plugins."""
    return NodeRegistry(dict(BUILT_IN))
