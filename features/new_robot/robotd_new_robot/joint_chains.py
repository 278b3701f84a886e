"""Joint groups proposed for a URDF: the serial chains between the branches of its tree."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile

from robotd.api.models import NAME, UrdfJoint, UrdfRobot
from robotd_new_robot.answers import legal_name

_GENERIC = re.compile(r"_*(joint|axis|link)?_*[0-9]*$", re.IGNORECASE)


def propose_groups(
    urdf: UrdfRobot, joints: Sequence[UrdfJoint], known: Mapping[str, Sequence[str]] | None = None
) -> Mapping[str, tuple[UrdfJoint, ...]]:
    """Return groups by name; empty for a single chain, which needs none.

    A torso with two arms gives three groups. One joint at the end of a chain, such as a servo
    gripper, belongs to the chain that carries it.

    Args:
        joints: with an axis each, depth first.
        known: names of joints of groups that share none; chains are proposed for the other joints.
    """
    taken = {joint.name for joint in joints}
    groups: dict[str, tuple[UrdfJoint, ...]] = {}
    for name, members in (known or {}).items():
        if held := tuple(joint for joint in joints if joint.name in members):
            groups[_legal(name, taken)] = held
    rest = [joint for joint in joints if not any(joint in held for held in groups.values())]
    chains = _chains(urdf, rest)
    if not groups and len(chains) < 2:
        return {}
    return {**groups, **dict(zip(_names(chains, taken), map(tuple, chains), strict=True))}


def _chains(urdf: UrdfRobot, joints: Sequence[UrdfJoint]) -> list[list[UrdfJoint]]:
    carriers = {joint.name: carrier(urdf, joint, joints) for joint in joints}
    carried = {joint.name: [j for j in joints if carriers[j.name] is joint] for joint in joints}
    chain_of: dict[str, list[UrdfJoint]] = {}
    chains: list[list[UrdfJoint]] = []
    for joint in joints:
        before = carriers[joint.name]
        if before and (len(carried[before.name]) == 1 or not carried[joint.name]):
            chain = chain_of[before.name]
        else:
            chain = []
            chains.append(chain)
        chain.append(joint)
        chain_of[joint.name] = chain
    return chains


def _names(chains: Sequence[Sequence[UrdfJoint]], taken: set[str]) -> list[str]:
    """Return a name for each chain that is none of ``taken``.

    Where the common beginnings of the joints say nothing, as in joint_1 to joint_14, the links say
    more; where they do not either, the last link names the chain.
    """
    for part in ("name", "child"):
        names = [_common_beginning([getattr(joint, part) for joint in chain]) for chain in chains]
        if _usable(names, taken):
            return names
    return [_legal(chain[-1].child, taken) for chain in chains]


def carrier(urdf: UrdfRobot, joint: UrdfJoint, joints: Sequence[UrdfJoint]) -> UrdfJoint | None:
    """Return the nearest of ``joints`` that carries ``joint``."""
    link = joint.parent
    while link != urdf.root:
        holding = urdf.parent_joint[link]
        if holding in joints:
            return holding
        link = holding.parent
    return None


def _usable(names: Sequence[str], taken: set[str]) -> bool:
    """Return True for legal names that differ from each other and from those of ``taken``."""
    return len({*names} - taken) == len(names) and all(map(NAME.fullmatch, names))


def _legal(name: str, taken: set[str]) -> str:
    """Return a legal name like ``name`` that is not in ``taken``, and add it there."""
    plain = legal_name(name, "group")
    if plain in taken:
        plain = f"{plain}_group"
    unique, number = plain, 2
    while unique in taken:
        unique, number = f"{plain}_{number}", number + 1
    taken.add(unique)
    return unique


def _common_beginning(names: Sequence[str]) -> str:
    """Return the common beginning of the names, without ``joint`` and numbers; may be empty."""
    columns = zip(*names, strict=False)
    common = "".join(
        column[0] for column in takewhile(lambda letters: len({*letters}) == 1, columns)
    )
    if len(names) > 1 and "_" in common:
        common = common[: common.rindex("_")]
    return _GENERIC.sub("", common)
