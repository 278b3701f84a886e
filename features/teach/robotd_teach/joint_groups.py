"""Joint group of a robot by its name."""

from __future__ import annotations

from robotd.api import InvalidArgument, unknown_name
from robotd.api.robots import JointGroup, Robot


def joint_group(robot: Robot, name: str) -> JointGroup:
    """Return a joint group; "": the only one. Raises InvalidArgument."""
    groups = {key: group for key, group in robot.groups.items() if group.joint_names}
    if not groups:
        raise InvalidArgument(f"{robot.descriptor.name} has no joints")
    if not name and len(groups) > 1:
        raise InvalidArgument(f"name one of the joint groups {', '.join(groups)}")
    if name and name not in groups:
        raise InvalidArgument(unknown_name("joint group", name, groups))
    return groups[name] if name else next(iter(groups.values()))
