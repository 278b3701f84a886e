"""Grippers and hands at the ends of the arms of a URDF, and the frames of its tools.

A *finger* is a joint that grips, a *jaw* the only one of its gripper. *Coupled* fingers follow one
another. A *hand* is all fingers on one link, also of a gripper. In a robot's file a *gripper* is a
hand that opens and closes as a whole.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robotd.api.models import UrdfJoint, UrdfRobot
from robotd_new_robot.joint_chains import carrier

_JAW = frozenset({"gripper", "grip", "jaw", "finger", "claw", "thumb"})  # words of names
_WRIST = frozenset({"roll", "pitch", "yaw", "rotate", "rotation", "twist", "flex", "extension"})
_BODY = frozenset(
    [
        "leg",
        "hip",
        "knee",
        "thigh",
        "calf",
        "ankle",
        "foot",
        "toe",
        "head",
        "neck",
        "eye",
        "ear",
        "camera",
        "laser",
        "lidar",
        "sensor",
    ]
)
MAX_FINGER_M = 0.25  # from the palm to the fingertip
FINGER_SHARE = 0.5  # of the distance from the root to the palm
# Frames of a tool, the best first: a point between the fingers, the end of the arm, its parts.
_TOOL_FRAMES = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"tcp|grasp|gripper_frame|tool_?frame|tool_?cent|tool_?point",
        r"tool",
        r"(^|[_/])(eef|ee|end_?effector)($|_)",
        r"sole",
        r"foot",
        r"hand$|gripper$|palm",
        r"flange",
    )
)
_NO_TOOL = re.compile(
    r"camera|imu|optical|laser|rotor|sensor|led|range|accel|visual|collision|box|motor|mount|dh_",
    re.IGNORECASE,
)
TOOL_POINTS = 3  # of _TOOL_FRAMES: a jaw beside such a frame closes on it


@dataclass(frozen=True)
class Hand:
    """Gripper or hand.

    Attributes:
        joints: depth first, with those that follow another.
        carrier: joint of the arm that carries it; None: the robot is the hand.
    """

    joints: tuple[UrdfJoint, ...]
    carrier: UrdfJoint | None


def find_hands(
    urdf: UrdfRobot, joints: Sequence[UrdfJoint], coupled: Iterable[UrdfJoint]
) -> list[Hand]:
    """Return the grippers and hands of the robot.

    Their joints are fingers: short branches of one link at the end of an arm; a last joint called
    gripper or jaw, or beside the frame of a tool; and ``coupled``.

    Args:
        joints: moving ones without wheels, depth first.
        coupled: fingers that follow one another.
    """
    carriers = {joint.name: carrier(urdf, joint, joints) for joint in joints}
    carried: dict[str, list[UrdfJoint]] = {joint.name: [] for joint in joints}
    for joint in joints:
        if (holding := carriers[joint.name]) is not None:
            carried[holding.name].append(joint)
    fingers = {joint.name for joint in coupled}
    for joint in joints:
        branches = carried[joint.name]
        if len(branches) > 1 and all(_is_finger(urdf, joint, branch) for branch in branches):
            fingers |= {held.name for held in urdf.carries(joint)}
        before = carriers[joint.name]
        if not branches and before is not None and _is_jaw(urdf, joint, before):
            fingers.add(joint.name)
    hands: dict[str, list[UrdfJoint]] = {}
    holders: dict[str, UrdfJoint | None] = {}
    for joint in joints:
        if joint.name in fingers:
            holding = carriers[joint.name]
            while holding is not None and holding.name in fingers:
                holding = carriers[holding.name]
            key = holding.name if holding else ""
            hands.setdefault(key, []).append(joint)
            holders[key] = holding
    return [Hand(tuple(held), holders[key]) for key, held in hands.items()]


def tool_frame(urdf: UrdfRobot, last: UrdfJoint) -> str | None:
    """Return the link whose pose is that of the tool beyond the last joint of an arm.

    None if it is the link that the joint moves, or no frame is called as one of a tool.
    """
    depths = _fixed_links(urdf, last.child)
    for pattern in _TOOL_FRAMES:
        frames = [link for link in depths if pattern.search(link) and not _NO_TOOL.search(link)]
        if frames:
            best = max(frames, key=lambda link: depths[link])  # the first of the farthest
            return None if best == last.child else best
    return None


def _fixed_links(urdf: UrdfRobot, link: str) -> Mapping[str, int]:
    """Return the links that fixed joints hold to ``link``, and how many are between."""
    depths = {link: 0}
    for joint in urdf.joints:  # a parent comes before its children
        if not joint.moves and joint.parent in depths:
            depths[joint.child] = depths[joint.parent] + 1
    return depths


def _is_finger(urdf: UrdfRobot, palm: UrdfJoint, branch: UrdfJoint) -> bool:
    """Return True for a branch that is short for the arm that carries it."""
    members = [branch, *urdf.carries(branch)]
    if any(_words(joint) & _BODY for joint in members):
        return False
    start = urdf.pose(branch.child, {})[:3, 3]
    length = max(
        float(np.linalg.norm(urdf.pose(link, {})[:3, 3] - start))
        for link in urdf.subtree(branch.child)
    )
    distance = float(np.linalg.norm(urdf.pose(palm.child, {})[:3, 3]))
    return length < min(MAX_FINGER_M, FINGER_SHARE * distance)


def _is_jaw(urdf: UrdfRobot, joint: UrdfJoint, before: UrdfJoint) -> bool:
    words = _words(joint)
    if "finger" in words & _words(before):
        return False  # a robot that is one finger
    if words & _JAW:
        return not words & _WRIST
    beside = _fixed_links(urdf, joint.parent)
    patterns = _TOOL_FRAMES[:TOOL_POINTS]
    own = tool_frame(urdf, joint)
    return own is None and any(
        pattern.search(link) for link in beside for pattern in patterns if link != joint.parent
    )


def _words(joint: UrdfJoint) -> set[str]:
    """Return the words in the names of a joint and of the link that it moves."""
    text = f"{joint.name} {joint.child}"
    parts = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text)
    return {part.lower().removesuffix("s") for part in parts}
