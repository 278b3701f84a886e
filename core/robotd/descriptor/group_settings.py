"""Joint groups: joints that are moved together, independently of other groups."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from pydantic import Field

from robotd.descriptor.section import Name, Problem, Section
from robotd.errors import unknown_name

ALL_JOINTS = "joints"  # name of the only group of a robot that names none


class GroupSettings(Section):
    """Joints with a trajectory action and a stream of their own."""

    joints: tuple[Name, ...] = Field(
        strict=False,
        description="Names of joints, in the order of the group's commands. Every joint of the "
        "robot is in one group.",
    )
    tool_link: str | None = Field(
        None,
        description="Link of the URDF whose pose is that of the group's tool; null: the one that "
        "its last joint moves.",
    )


def group_problems(groups: Mapping[str, GroupSettings], joints: Sequence[str]) -> Iterator[Problem]:
    """Yield unknown joints, joints of two groups, and joints of none where there are groups."""
    group_of: dict[str, str] = {}
    for name, group in groups.items():
        if not group.joints:
            yield ("groups", name, "joints"), "must name a joint", list(group.joints)
        for index, joint in enumerate(group.joints):
            keys = ("groups", name, "joints", index)
            if joint not in joints:
                yield keys, unknown_name("joint", joint, joints), joint
            elif joint in group_of:
                yield keys, f"is in group {group_of[joint]!r} already", joint
            group_of.setdefault(joint, name)
    if groups:
        available = ", ".join(groups)
        for index, joint in enumerate(joints):
            if joint not in group_of:
                yield ("joints", index, "name"), f"is in no group (available: {available})", joint
