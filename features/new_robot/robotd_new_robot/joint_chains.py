"""Joint groups proposed for a URDF: the serial chains between the branches of its tree."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile

from robotd.api.models import NAME, UrdfJoint, UrdfRobot
from robotd_new_robot.answers import legal_name

ARM_JOINTS = 3  # least of a chain that is called the arm
_GENERIC = re.compile(r"_*(joint|axis|link)?_*[0-9]*$", re.IGNORECASE)


def propose_groups(
    urdf: UrdfRobot,
    joints: Sequence[UrdfJoint],
    hands: Sequence[Sequence[UrdfJoint]] = (),
    known: Mapping[str, Sequence[str]] | None = None,
) -> Mapping[str, tuple[UrdfJoint, ...]]:
    """Return groups by name; empty for a single chain, which needs none.

    A torso with two arms gives three groups, and each gripper or hand one of its own.

    Args:
        joints: with an axis each, depth first.
        hands: joints of each gripper or hand.
        known: names of joints of groups that share none; chains are proposed for the other joints.
    """
    taken = {joint.name for joint in joints}
    groups: dict[str, tuple[UrdfJoint, ...]] = {}
    for name, members in (known or {}).items():
        if held := tuple(joint for joint in joints if joint.name in members):
            groups[_legal(name, taken)] = held
    rest = [joint for joint in joints if not any(joint in held for held in groups.values())]
    fingers = [held for hand in hands if (held := tuple(j for j in rest if j in hand))]
    rest = [joint for joint in rest if not any(joint in held for held in fingers)]
    chains = _chains(urdf, rest)
    if not groups and len(chains) + len(fingers) < 2:
        return {}
    groups |= dict(zip(_names(chains, taken), map(tuple, chains), strict=True))
    for held in fingers:
        kind = "gripper" if len(held) == 1 else "hand"
        arm = _arm_of(urdf, held[0], groups) if len(fingers) > 1 else ""
        groups[_legal(f"{arm}_{kind}" if arm else kind, {*groups})] = held
    return groups


def _arm_of(urdf: UrdfRobot, joint: UrdfJoint, groups: Mapping[str, Sequence[UrdfJoint]]) -> str:
    """Return the group whose joints carry ``joint``; "" without."""
    holding = carrier(urdf, joint, [held for group in groups.values() for held in group])
    return next((name for name, group in groups.items() if holding in group), "")


def _chains(urdf: UrdfRobot, joints: Sequence[UrdfJoint]) -> list[list[UrdfJoint]]:
    carriers = {joint.name: carrier(urdf, joint, joints) for joint in joints}
    carried = {joint.name: [j for j in joints if carriers[j.name] is joint] for joint in joints}
    chain_of: dict[str, list[UrdfJoint]] = {}
    chains: list[list[UrdfJoint]] = []
    for joint in joints:
        before = carriers[joint.name]
        if before and len(carried[before.name]) == 1:
            chain = chain_of[before.name]
        else:
            chain = []
            chains.append(chain)
        chain.append(joint)
        chain_of[joint.name] = chain
    return chains


def _names(chains: Sequence[Sequence[UrdfJoint]], taken: set[str]) -> list[str]:
    """Return a name for each chain that is none of ``taken``.

    Where the common beginning of the joints says nothing, as in joint_1 to joint_14, that of the
    links says more; where it does not either, the last link names the chain, or it is the arm.
    """
    last = [legal_name(chain[-1].child, "group") for chain in chains]
    for numbered in (False, True):  # with the number where only it differs: panda_1, panda_2
        names = [_chain_name(chain, numbered=numbered) for chain in chains]
        unnamed = [chain for chain, name in zip(chains, names, strict=True) if not name]
        if len(unnamed) == 1 and len(unnamed[0]) >= ARM_JOINTS:
            names[names.index("")] = "arm"
        names = [name or link for name, link in zip(names, last, strict=True)]
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


def _chain_name(chain: Sequence[UrdfJoint], *, numbered: bool) -> str:
    """Return the common beginning of the joints, or of their links; "" where both say nothing."""
    for part in ("name", "child"):
        name = _common_beginning([getattr(joint, part) for joint in chain], numbered=numbered)
        if NAME.fullmatch(name) and _GENERIC.sub("", name):
            return name
    return ""


def _common_beginning(names: Sequence[str], *, numbered: bool) -> str:
    """Return the common beginning of the names; may be empty.

    It is without ``joint`` and numbers at its end; with them if ``numbered``, where a part of the
    name follows.
    """
    columns = zip(*names, strict=False)
    common = "".join(
        column[0] for column in takewhile(lambda letters: len({*letters}) == 1, columns)
    )
    if len(names) > 1 and "_" in common:
        common = common[: common.rindex("_")]
        if numbered:
            return common
    return _GENERIC.sub("", common)
