"""Assignment of a leader's joints to those of a robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robotd.api import InvalidArgument, RobotDescriptor, unknown_name

FORM = "LEADER=JOINT[:SCALE[:OFFSET]]"


@dataclass(frozen=True)
class JointMapping:
    """Position of ``joint`` = ``scale`` x position of ``leader`` + ``offset``, rad or m."""

    leader: str
    joint: str
    scale: float = 1.0
    offset: float = 0.0


def parse_mapping(text: str) -> JointMapping:
    """Read ``shoulder_pan=joint1:-1:0.5``. Raises InvalidArgument."""
    leader, equals, rest = text.partition("=")
    joint, *numbers = rest.split(":")
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        values = [math.nan]
    valid = leader and equals and joint and len(values) <= 2 and all(map(math.isfinite, values))
    if not valid or values[:1] == [0.0]:
        raise InvalidArgument(f"{text!r} is not {FORM}, with a scale that is not 0")
    return JointMapping(leader, joint, *values)


def joint_map(
    leader: RobotDescriptor, robot: RobotDescriptor, given: Sequence[JointMapping]
) -> tuple[JointMapping, ...]:
    """Return the given mappings, checked; without any those of joints with the same name.

    Raises InvalidArgument: an unknown joint, one that is moved twice, or none at all.
    """
    for mapping in given:
        for name, of in ((mapping.leader, leader), (mapping.joint, robot)):
            if name not in of.joint_names:
                raise InvalidArgument(f"{of.name}: {unknown_name('joint', name, of.joint_names)}")
    moved = [mapping.joint for mapping in given]
    for joint in moved:
        if moved.count(joint) > 1:
            raise InvalidArgument(f"{joint} is mapped twice")
    same = [JointMapping(name, name) for name in leader.joint_names if name in robot.joint_names]
    found = tuple(given) or tuple(same)
    if not found:
        joints = f"{leader.name} has {', '.join(leader.joint_names)}"
        others = f"{robot.name} has {', '.join(robot.joint_names)}"
        raise InvalidArgument(
            f"no joints of one name, map some by --map {FORM}: {joints}; {others}"
        )
    return found
