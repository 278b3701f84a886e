"""Groups and passive joints of an SRDF, which MoveIt has in addition to a URDF."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robotd.api import DescriptorError, get_logger
from robotd.api.models import MAX_URDF_BYTES, UrdfRobot, read_limited, xml_root

log = get_logger("new-robot")


@dataclass(frozen=True)
class Srdf:
    """Groups and passive joints of an SRDF, by the URDF's names of joints.

    Attributes:
        groups: moving joints of each group, in the order of the URDF's tree. Groups may overlap.
        passive: joints that no drive moves.
    """

    groups: Mapping[str, tuple[str, ...]]
    passive: tuple[str, ...]


def read_srdf(path: Path, urdf: UrdfRobot) -> Srdf:
    """Read an SRDF of the robot ``urdf``.

    What it says about joints and links that the URDF does not have is logged and ignored, as
    srdfdom does.

    Raises DescriptorError: not readable, no SRDF, or no group has a joint of this robot.
    """
    root = xml_root(read_limited(path, MAX_URDF_BYTES), path)
    if root.tag != "robot" or root.find("link") is not None:
        raise DescriptorError("is not an SRDF: a <robot> with <group> elements", path=path)
    members = _Members(root, urdf)
    moving = [joint.name for joint in urdf.joints if joint.moves]
    groups = {}
    for name in members.elements:
        held = members.joints(name)
        if joints := tuple(joint for joint in moving if joint in held):
            groups[name] = joints
    if members.elements and not groups:
        what = f"no group has a joint of the URDF of {urdf.name or 'the robot'}"
        raise DescriptorError(what, path=path)
    if members.unknown:
        log.warning("SRDF: names that the URDF does not have are ignored", names=members.unknown)
    passive = [element.get("name", "") for element in root.iterfind("passive_joint")]
    return Srdf(groups, tuple(joint for joint in moving if joint in passive))


def disjoint_groups(groups: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Return those of the groups that share no joint.

    Of groups that overlap the smaller ones are taken where they have half of the joints of the
    larger one: the arm of an arm with a torso, both arms of two, but not the wrist of an arm.
    """
    taken: dict[str, tuple[str, ...]] = {}
    for name, joints in sorted(groups.items(), key=lambda group: len(group[1])):
        inside = [other for other in taken if set(taken[other]) & set(joints)]
        if 2 * sum(len(taken[other]) for other in inside) >= len(joints):
            continue
        for other in inside:
            del taken[other]
        taken[name] = tuple(joints)
    return {name: taken[name] for name in groups if name in taken}


class _Members:
    """Joints of the groups of an SRDF.

    Attributes:
        elements: of the groups, by name.
        unknown: names of joints, links and groups that do not exist.
    """

    def __init__(self, root: Any, urdf: UrdfRobot) -> None:
        self._urdf = urdf
        self.elements = {element.get("name", ""): element for element in root.iterfind("group")}
        self.unknown: list[str] = []

    def joints(self, group: str, around: Sequence[str] = ()) -> set[str]:
        """Return the joints of a group; ``around`` are the groups that contain it."""
        element, urdf = self.elements[group], self._urdf
        found = {name for name in _names(element, "joint") if self._is_known(name, urdf.joint)}
        for link in _names(element, "link"):
            if self._is_known(link, urdf.links) and link != urdf.root:
                found.add(urdf.parent_joint[link].name)
        for chain in element.iterfind("chain"):
            base, tip = chain.get("base_link", ""), chain.get("tip_link", "")
            if self._is_known(base, urdf.links) and self._is_known(tip, urdf.links):
                # From one end up to the nearest link that holds both, and down to the other.
                found |= _above(base, urdf) ^ _above(tip, urdf)
        for inner in _names(element, "group"):
            if inner not in (group, *around) and self._is_known(inner, self.elements):
                found |= self.joints(inner, (*around, group))
        return found

    def _is_known(self, name: str, names: Container[str]) -> bool:
        if name not in names and name not in self.unknown:
            self.unknown.append(name)
        return name in names


def _names(element: Any, tag: str) -> list[str]:
    return [child.get("name", "") for child in element.iterfind(tag)]


def _above(link: str, urdf: UrdfRobot) -> set[str]:
    """Return the joints from the root to a link."""
    found = set()
    while link != urdf.root:
        joint = urdf.parent_joint[link]
        found.add(joint.name)
        link = joint.parent
    return found
