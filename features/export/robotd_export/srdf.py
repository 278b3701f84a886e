"""SRDF of a robot: planning groups, gripper, passive joints, and collisions that cannot happen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lxml import etree

from robotd.api.models import ALL_JOINTS, RobotDescriptor, UrdfJoint, UrdfRobot
from robotd_export.collision_shapes import collision_covers
from robotd_export.disabled_collisions import disabled_collisions

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
        path: of the URDF.
    """
    root = etree.Element("robot", name=urdf.name)
    groups = chain_groups(urdf, descriptor)
    for name, (joints, tip) in groups.items():
        group = etree.SubElement(root, "group", name=name)
        if tip:
            etree.SubElement(group, "chain", base_link=joints[0].parent, tip_link=tip)
        else:
            _add_all(group, "joint", [joint.name for joint in joints])
    for name, (joints, _) in groups.items():
        state = etree.SubElement(root, "group_state", name=HOME, group=name)
        for joint in joints:
            # Not rounded, which could be beyond the limit.
            value = repr(min(max(0.0, joint.lower), joint.upper))
            etree.SubElement(state, "joint", name=joint.name, value=value)
    fingers = descriptor.gripper.joints if descriptor.gripper else ()
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


def _add_all(parent: Any, tag: str, names: list[str]) -> None:
    for name in names:
        etree.SubElement(parent, tag, name=name)


def _add_gripper(
    root: Any,
    urdf: UrdfRobot,
    fingers: tuple[str, ...],
    groups: dict[str, tuple[tuple[UrdfJoint, ...], str]],
) -> None:
    """Add the group of the fingers, and its end effector."""
    group = etree.SubElement(root, "group", name=GRIPPER)
    _add_all(group, "joint", [*fingers])
    holder = urdf.joint[fingers[0]].parent
    carrying = [name for name, (joints, _) in groups.items() if holder in _carried(urdf, joints)]
    if carrying:
        etree.SubElement(
            root,
            "end_effector",
            name=GRIPPER,
            parent_link=holder,
            group=GRIPPER,
            parent_group=carrying[0],
        )


def _carried(urdf: UrdfRobot, joints: tuple[UrdfJoint, ...]) -> list[str]:
    return urdf.subtree(joints[-1].child)


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
