"""Joint groups proposed for a URDF: the serial chains between the branches of its tree."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile

from robotd.descriptor.section import NAME
from robotd.descriptor.urdf import UrdfJoint, UrdfRobot

_GENERIC = re.compile(r"_*(joint|axis|link)?_*[0-9]*$", re.IGNORECASE)


def propose_groups(
    urdf: UrdfRobot, joints: Sequence[UrdfJoint]
) -> Mapping[str, tuple[UrdfJoint, ...]]:
    """Return groups by name; empty for a single chain, which needs none.

    A torso with two arms gives three groups. One joint at the end of a chain, such as a servo
    gripper, belongs to the chain that carries it.

    Args:
        urdf: of the robot.
        joints: with an axis each, depth first.
    """
    carrier = {joint.name: _carrier(urdf, joint, joints) for joint in joints}
    carried = {each.name: [j for j in joints if carrier[j.name] is each] for each in joints}
    chain_of: dict[str, list[UrdfJoint]] = {}
    chains: list[list[UrdfJoint]] = []
    for joint in joints:
        before = carrier[joint.name]
        if before and (len(carried[before.name]) == 1 or not carried[joint.name]):
            chain = chain_of[before.name]
        else:
            chain = []
            chains.append(chain)
        chain.append(joint)
        chain_of[joint.name] = chain
    if len(chains) < 2:
        return {}
    names = [_name([joint.name for joint in chain]) for chain in chains]
    if not _usable(names, joints):  # joints such as joint_1, whose links say more
        names = [_name([joint.child for joint in chain]) for chain in chains]
    if not _usable(names, joints):
        names = [f"group{number}" for number in range(1, len(chains) + 1)]
    return {name: tuple(chain) for name, chain in zip(names, chains, strict=True)}


def _carrier(urdf: UrdfRobot, joint: UrdfJoint, joints: Sequence[UrdfJoint]) -> UrdfJoint | None:
    """Return the nearest of ``joints`` that carries ``joint``."""
    link = joint.parent
    while link != urdf.root:
        holding = urdf.parent_joint[link]
        if holding in joints:
            return holding
        link = holding.parent
    return None


def _usable(names: Sequence[str], joints: Sequence[UrdfJoint]) -> bool:
    """Return True for legal names that differ from each other and from the joints."""
    clash = len({*names, *(joint.name for joint in joints)}) < len(names) + len(joints)
    return not clash and all(map(NAME.fullmatch, names))


def _name(names: Sequence[str]) -> str:
    """Return the common beginning of the names, without ``joint`` and numbers; may be empty."""
    columns = zip(*names, strict=False)
    common = "".join(column[0] for column in takewhile(lambda each: len({*each}) == 1, columns))
    if len(names) > 1 and "_" in common:
        common = common[: common.rindex("_")]
    return _GENERIC.sub("", common)
