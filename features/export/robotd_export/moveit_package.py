"""MoveIt configuration package: URDF, SRDF with named states, limits, controllers, launch file.

It is the package that the Setup Assistant would write. Layout and names are those that
``MoveItConfigsBuilder`` of moveit_configs_utils reads (Jazzy).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lxml import etree

from robotd.api.models import (
    ALL_JOINTS,
    RobotDescriptor,
    UrdfJoint,
    UrdfRobot,
    mesh_files,
    parse_urdf,
)
from robotd_export.disabled_collisions import collision_covers, disabled_collisions
from robotd_export.export_input import ExportInput
from robotd_export.moveit import move_group_content
from robotd_shared.mesh_files import moved_mesh_names, with_mesh_names
from robotd_shared.pose_file import file_of, read_poses

PLANNER = "RRTConnectkConfigDefault"
OMPL = {
    "planning_plugins": ["ompl_interface/OMPLPlanner"],
    "request_adapters": [
        "default_planning_request_adapters/ResolveConstraintFrames",
        "default_planning_request_adapters/ValidateWorkspaceBounds",
        "default_planning_request_adapters/CheckStartStateBounds",
        "default_planning_request_adapters/CheckStartStateCollision",
    ],
    "response_adapters": [
        "default_planning_response_adapters/AddTimeOptimalParameterization",
        "default_planning_response_adapters/ValidateSolution",
        "default_planning_response_adapters/DisplayMotionPath",
    ],
    "planner_configs": {PLANNER: {"type": "geometric::RRTConnect", "range": 0.0}},
}
KDL = {
    "kinematics_solver": "kdl_kinematics_plugin/KDLKinematicsPlugin",
    "kinematics_solver_search_resolution": 0.005,
    "kinematics_solver_timeout": 0.05,
}
DEPENDENCIES = (
    "launch_ros",
    "moveit_configs_utils",
    "moveit_kinematics",
    "moveit_planners_ompl",
    "moveit_ros_move_group",
    "moveit_simple_controller_manager",
    "robot_state_publisher",
)
ARM = "arm"  # planning group of a robot that names no joint groups
GRIPPER = "gripper"
HOME = "home"  # joints at 0, or at the limit that is nearest


def chain_groups(
    urdf: UrdfRobot, descriptor: RobotDescriptor
) -> dict[str, tuple[tuple[UrdfJoint, ...], str]]:
    """Return joints and tip of each planning group; "" without a serial chain."""
    found = {}
    for group, settings in descriptor.joint_groups.items():
        joints = tuple(urdf.joint[joint.name] for joint in settings)
        tip = _tip(urdf, joints, descriptor.tool_links.get(group))
        found[ARM if group == ALL_JOINTS else group] = (joints, tip)
    return found


def semantic_description(
    urdf: UrdfRobot, descriptor: RobotDescriptor, text: str, path: Path
) -> str:
    """Return the SRDF.

    Args:
        descriptor: its groups, tools and gripper.
        text: of the URDF, for its collision shapes.
    """
    root = etree.Element("robot", name=urdf.name)
    groups = chain_groups(urdf, descriptor)
    for name, (joints, tip) in groups.items():
        group = etree.SubElement(root, "group", name=name)
        if tip:
            etree.SubElement(group, "chain", base_link=joints[0].parent, tip_link=tip)
        else:
            _add_all(group, "joint", [joint.name for joint in joints])
    _add_states(root, descriptor, {name: joints for name, (joints, _) in groups.items()})
    fingers = _finger_ends(descriptor)
    if fingers:
        _add_gripper(root, urdf, fingers, groups)
    moved = {*descriptor.joint_names, *fingers}
    passive = [joint.name for joint in urdf.joints if joint.moves and joint.name not in moved]
    _add_all(root, "passive_joint", passive)
    root.append(etree.Comment(" Pairs of links that cannot collide, shown by their geometry. "))
    for first, second, reason in disabled_collisions(urdf, collision_covers(text, path)):
        etree.SubElement(root, "disable_collisions", link1=first, link2=second, reason=reason)
    data: bytes = etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8")
    return data.decode()


def _add_states(
    root: Any, descriptor: RobotDescriptor, groups: dict[str, tuple[UrdfJoint, ...]]
) -> None:
    """Add the taught poses of each group, and ``HOME`` where it is not taught."""
    ours = {joint.name: joint for joint in descriptor.joints}  # may be tighter than the URDF's
    poses = read_poses(file_of(descriptor))
    for group, joints in groups.items():
        limits = {
            joint.name: (
                max(joint.lower, ours[joint.name].lower),
                min(joint.upper, ours[joint.name].upper),
            )
            for joint in joints
        }
        home = {joint: min(max(0.0, lower), upper) for joint, (lower, upper) in limits.items()}
        taught = {name: pose for name, pose in poses.items() if pose.keys() == limits.keys()}
        for name, pose in ({HOME: home} | taught).items():
            beyond = [
                joint for joint, (low, high) in limits.items() if not low <= pose[joint] <= high
            ]
            if beyond:
                text = f" The pose {name} of {group} is beyond the limits of {', '.join(beyond)}. "
                root.append(etree.Comment(text.replace("--", "- -")))  # would end the comment
                continue
            state = etree.SubElement(root, "group_state", name=name, group=group)
            for joint in limits:  # not rounded, which could be beyond the limit
                etree.SubElement(state, "joint", name=joint, value=repr(pose[joint]))


def _add_all(parent: Any, tag: str, names: list[str]) -> None:
    for name in names:
        etree.SubElement(parent, tag, name=name)


def _finger_ends(descriptor: RobotDescriptor) -> dict[str, tuple[float, float]]:
    """Return the positions of each finger when open and when closed; none without a gripper."""
    gripper = descriptor.gripper
    if gripper is None:
        return {}
    factors = gripper.multipliers or (1.0,) * len(gripper.joints)
    return {
        finger: (gripper.open_m * factor, gripper.closed_m * factor)
        for finger, factor in zip(gripper.joints, factors, strict=True)
    }


def _add_gripper(
    root: Any,
    urdf: UrdfRobot,
    fingers: dict[str, tuple[float, float]],
    groups: dict[str, tuple[tuple[UrdfJoint, ...], str]],
) -> None:
    """Add the group of the fingers, its two ends as states, and its end effector."""
    group = etree.SubElement(root, "group", name=GRIPPER)
    _add_all(group, "joint", [*fingers])
    for index, name in enumerate(("open", "closed")):
        state = etree.SubElement(root, "group_state", name=name, group=GRIPPER)
        for finger, ends in fingers.items():
            etree.SubElement(state, "joint", name=finger, value=repr(ends[index]))
    owners = {
        link: name
        for name, (joints, tip) in groups.items()
        for link in _group_links(urdf, joints, tip)
    }
    link = urdf.joint[next(iter(fingers))].parent
    while link != urdf.root and link not in owners:  # such as the body of the gripper
        link = urdf.parent_joint[link].parent
    if link in owners:
        etree.SubElement(
            root,
            "end_effector",
            name=GRIPPER,
            parent_link=link,
            group=GRIPPER,
            parent_group=owners[link],
        )


def _group_links(urdf: UrdfRobot, joints: tuple[UrdfJoint, ...], tip: str) -> list[str]:
    """Return the links that are part of a planning group to MoveIt."""
    links = [joint.child for joint in joints]
    while tip and tip not in links:  # a tool after the last joint
        links.append(tip)
        tip = urdf.parent_joint[tip].parent
    return links


def _tip(urdf: UrdfRobot, joints: tuple[UrdfJoint, ...], tool: str | None) -> str:
    """Return the last link of a serial chain, or its tool; "" for none."""
    tip = joints[-1].child
    between, link = [], tip
    while link not in (joints[0].parent, urdf.root):
        joint = urdf.parent_joint[link]
        between.append(joint)
        link = joint.parent
    moving = [joint for joint in between[::-1] if joint.moves]
    if link != joints[0].parent or moving != [*joints]:
        return ""
    return tool if tool in _rigid_with(urdf, tip) else tip


def _rigid_with(urdf: UrdfRobot, link: str) -> set[str]:
    """Return the links that no moving joint separates from ``link``, beyond it."""
    found = {link}
    for joint in urdf.joints:  # a parent comes before its children
        if joint.parent in found and not joint.moves:
            found.add(joint.child)
    return found


def moveit_package(source: ExportInput) -> dict[str, str]:
    """Return the files of the package by their paths: URDF, SRDF, parameters, launch file.

    Raises DescriptorError for a robot without joints, trajectory action or URDF, and for names that
    MoveIt could not tell apart.
    """
    descriptor, name = source.descriptor, source.descriptor.name
    content = move_group_content(source)
    servo = content.pop("moveit_servo", None)
    limits = content.pop("robot_description_planning")
    text, path = source.urdf(), source.urdf_path()
    # MoveIt finds neither relative meshes nor packages that are only beside the URDF.
    text = with_mesh_names(text, moved_mesh_names(mesh_files(text, path), None))
    urdf = parse_urdf(text, path)
    _check_group_names(source)
    groups = chain_groups(urdf, descriptor)
    pipeline = OMPL | {group: {"planner_configs": [PLANNER]} for group in groups}
    solvers = {group: KDL for group, (_, tip) in groups.items() if tip}
    files = {
        "package.xml": _package_xml(name),
        "CMakeLists.txt": _cmake_lists(name),
        ".setup_assistant": source.document([], _setup_assistant(name)),
        f"config/{name}.urdf": text,
        f"config/{name}.srdf": semantic_description(urdf, descriptor, text, path),
        "config/joint_limits.yaml": source.document([], limits),
        "config/kinematics.yaml": source.document([], solvers),
        "config/moveit_controllers.yaml": source.document([], content),
        "config/ompl_planning.yaml": source.document([], pipeline),
        "launch/move_group.launch.py": _launch_file(source),
    }
    if servo is not None:
        servo |= {"move_group_name": next(iter(groups))}
        parameters = {"/**": {"ros__parameters": {"moveit_servo": servo}}}
        files["config/servo.yaml"] = source.document([], parameters)
    return files


def _check_group_names(source: ExportInput) -> None:
    """Raise DescriptorError for joint groups with a name that the configuration has already."""
    descriptor = source.descriptor
    taken = dict.fromkeys(OMPL, "a parameter of the planning pipeline")
    if descriptor.gripper and descriptor.gripper.joints:
        taken[GRIPPER] = "the planning group of the gripper's fingers"
    for group in descriptor.groups:
        if group in taken:
            what = f"a joint group is named {group!r}, as {taken[group]}: rename it"
            raise source.rejection(f"moveit_package: groups.{group}: {what}")


def package_name(robot: str) -> str:
    """Return the name of the package of a robot's configuration."""
    return f"{robot.lower()}_moveit_config"


def _setup_assistant(name: str) -> dict[str, Any]:
    return {
        "moveit_setup_assistant_config": {
            "urdf": {"package": package_name(name), "relative_path": f"config/{name}.urdf"},
            "srdf": {"relative_path": f"config/{name}.srdf"},
        }
    }


def _package_xml(name: str) -> str:
    depends = "".join(f"  <exec_depend>{dependency}</exec_depend>\n" for dependency in DEPENDENCIES)
    return f"""<?xml version="1.0"?>
<package format="3">
  <name>{package_name(name)}</name>
  <version>0.1.0</version>
  <description>MoveIt configuration of {name}, made by robotd export moveit_package</description>
  <maintainer email="robotd@localhost">robotd</maintainer>
  <license>MIT</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
{depends}  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""


def _cmake_lists(name: str) -> str:
    return f"""cmake_minimum_required(VERSION 3.22)
project({package_name(name)})
find_package(ament_cmake REQUIRED)
ament_package()
install(DIRECTORY config launch DESTINATION share/${{PROJECT_NAME}})
install(FILES .setup_assistant DESTINATION share/${{PROJECT_NAME}})
"""


def _launch_file(source: ExportInput) -> str:
    name = source.descriptor.name
    publishes = "robot_state_publisher" in source.descriptor.nodes
    publisher = (
        ""
        if publishes
        else """        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[moveit.robot_description],
        ),
"""
    )
    return f'''"""move_group for {name}, beside: robotd run --robot {name}"""

from launch import LaunchDescription
from launch_ros.actions import Node
from moveit_configs_utils import MoveItConfigsBuilder

# The topic monitored_planning_scene, which RViz and robotd subscribe to.
MONITORED_SCENE = {{
    "publish_planning_scene": True,
    "publish_geometry_updates": True,
    "publish_state_updates": True,
    "publish_transforms_updates": True,
}}


def generate_launch_description():
    builder = MoveItConfigsBuilder("{name}", package_name="{package_name(name)}")
    moveit = builder.planning_pipelines(pipelines=["ompl"]).to_moveit_configs()
    return LaunchDescription([
{publisher}        Node(
            package="moveit_ros_move_group",
            executable="move_group",
            output="screen",
            parameters=[moveit.to_dict(), MONITORED_SCENE],
        ),
    ])
'''
