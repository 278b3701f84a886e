"""MoveIt 2: parameters of move_group and MoveIt Servo for executing on this robot.

The names are those of MoveItSimpleControllerManager, of the trajectory execution manager, of
``robot_description_planning`` and of ``moveit_servo``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robotd.api.models import JointSettings, JointType, RobotDescriptor
from robotd_export.export_input import ExportInput
from robotd_ros.group_parameters import ACTION_PARAMETER, default_action, group_prefixes

SERVER = "follow_joint_trajectory_server"
GRIPPER_NODE = "gripper_controller"
COMMAND_NODE = "joint_command_node"
STATE_NODE = "manipulator_state"
TRAJECTORY_TOPIC = "joint_trajectory_topic"  # of a group

# Longest time from the planned end of a trajectory to its result, plus goal_time_s: a device
# may still be moving for 2 s, and a joint that creeps at the end is reported after 2 s more. The
# rest is for planning before the start and for the delay of the messages.
RESULT_DELAY_S = 5.0
MANAGER = "moveit_simple_controller_manager"


def move_group_parameters(source: ExportInput) -> str:
    """Return a ROS parameter file: controllers, joint limits, execution, Servo.

    Raises DescriptorError for a robot without joints or without the trajectory action.
    """
    content = move_group_content(source)
    return source.document(_remarks(source), {"/**": {"ros__parameters": content}})


def move_group_content(source: ExportInput) -> dict[str, Any]:
    """Return the parameters of move_group and Servo that depend on the robot.

    Raises DescriptorError for a robot without joints or without the trajectory action.
    """
    descriptor = source.descriptor
    if not descriptor.joints:
        raise source.rejection(f"moveit: {descriptor.name} has no joints")
    actions = _actions(source)
    limits = {joint.name: _limits(joint) for joint in descriptor.joints}
    content = {
        "moveit_controller_manager": f"{MANAGER}/MoveItSimpleControllerManager",
        MANAGER: _controllers(source, actions),
        "trajectory_execution": _execution(source),
        "robot_description_planning": {"joint_limits": limits},
    }
    topics = _servo_topics(source)
    if len(topics) == 1:
        content["moveit_servo"] = _servo(source, *topics)
    return content


def _actions(source: ExportInput) -> dict[str, Sequence[str]]:
    """Return the joints of each trajectory action, by its resolved name."""
    groups = source.descriptor.joint_groups
    return {
        source.needed_topic(
            SERVER, f"{prefix}{ACTION_PARAMETER}", default_action(source.descriptor, group)
        ): [joint.name for joint in groups[group]]
        for group, prefix in group_prefixes(source.descriptor).items()
    }


def _controllers(source: ExportInput, actions: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return the controller list; MoveIt joins a name and its ``action_ns`` by a slash.

    Raises DescriptorError for two actions of one name: to MoveIt they would be one controller.
    """
    kinds = {action: ("FollowJointTrajectory", joints) for action, joints in actions.items()}
    if gripper := _gripper_action(source):
        settings = source.descriptor.gripper
        kinds[gripper] = ("GripperCommand", settings.joints if settings else ())
    controllers: dict[str, Any] = {}
    action_of: dict[str, str] = {}
    for action, (kind, joints) in kinds.items():
        name, controller = _controller(action, kind, joints)
        if name in controllers:
            what = f"the actions {action_of[name]} and {action} are both of a controller {name!r}"
            how = "rename one by its parameter, or the joint group: what precedes the last / counts"
            raise source.rejection(f"moveit: {what}; {how}")
        controllers[name], action_of[name] = controller, action
    return {"controller_names": list(controllers), **controllers}


def _controller(action: str, kind: str, joints: Sequence[str]) -> tuple[str, dict[str, Any]]:
    name, _, action_ns = action.removeprefix("/").rpartition("/")
    if not name:
        name, action_ns = action_ns, ""
    return name, {"type": kind, "action_ns": action_ns, "default": True, "joints": list(joints)}


def _gripper_action(source: ExportInput) -> str:
    """Return the resolved name of the gripper's action, "" where it has none."""
    has_node = GRIPPER_NODE in source.descriptor.nodes
    return source.topic(GRIPPER_NODE, "gripper_action") if has_node else ""


def _servo_topics(source: ExportInput) -> list[str]:
    """Return the topic of each joint group that takes the messages of MoveIt Servo."""
    if COMMAND_NODE not in source.descriptor.nodes:
        return []
    prefixes = group_prefixes(source.descriptor).values()
    topics = (source.topic(COMMAND_NODE, f"{prefix}{TRAJECTORY_TOPIC}") for prefix in prefixes)
    return [topic for topic in topics if topic]


def _servo(source: ExportInput, topic: str) -> dict[str, Any]:
    """Return the parameters of MoveIt Servo that depend on the robot, and its periods."""
    return {
        "command_out_topic": topic,
        "command_out_type": "trajectory_msgs/JointTrajectory",
        "publish_joint_positions": True,
        "publish_joint_velocities": True,
        "publish_joint_accelerations": False,
        "publish_period": 0.01,
        "max_expected_latency": 0.1,
        "joint_topic": source.topic(STATE_NODE, "encoder_joint_topic", "joint_states"),
    }


def _execution(source: ExportInput) -> dict[str, Any]:
    """Return the start tolerance of the robot, and a margin within which its result comes.

    The duration is not watched: at a lower speed, or in a pause, an execution takes longer than
    planned, and MoveIt would cancel it.
    """
    rules = source.descriptor.trajectory
    return {
        "execution_duration_monitoring": False,
        "allowed_start_tolerance": min(_start_tolerances(source.descriptor)),
        "allowed_goal_duration_margin": rules.goal_time_s + RESULT_DELAY_S,
    }


def _start_tolerances(descriptor: RobotDescriptor) -> set[float]:
    """Return those of the joints; MoveIt compares m and rad with the same number."""
    rules = descriptor.trajectory
    tolerances = {"rad": rules.start_tolerance_rad, "m": rules.start_tolerance_m}
    return {tolerances[joint.unit] for joint in descriptor.joints}


def _limits(joint: JointSettings) -> dict[str, Any]:
    positions = {"min_position": joint.lower, "max_position": joint.upper}
    is_limited = joint.type is not JointType.CONTINUOUS
    return {
        "has_position_limits": is_limited,
        **(positions if is_limited else {}),
        "has_velocity_limits": True,
        "max_velocity": joint.velocity,
        "has_acceleration_limits": True,
        "max_acceleration": joint.acceleration,
    }


def _remarks(source: ExportInput) -> list[str]:
    lines = [
        "Parameters of move_group (MoveIt 2), in addition to those of your MoveIt configuration."
    ]
    topics = _servo_topics(source)
    if len(topics) == 1:
        lines.append(
            "And of MoveIt Servo, whose move_group_name is the planning group of your SRDF."
        )
    elif topics:
        lines.append(f"MoveIt Servo: a node for each command_out_topic: {', '.join(topics)}.")
    gripper = source.descriptor.gripper
    if gripper and not _gripper_action(source):
        service = source.topic(SERVER, "wmx_gripper_topic")
        lines += [
            f"The gripper is the service {service} (std_srvs/srv/SetBool), not a controller of",
            f"MoveIt. Its joints are passive ones for the SRDF: {', '.join(gripper.joints)}.",
        ]
    return lines
