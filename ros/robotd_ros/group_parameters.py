"""Names of the ROS parameters of joint groups."""

from __future__ import annotations

from robotd.descriptor.model import RobotDescriptor

GROUPS = "joint_groups"  # parameter that lists the groups
JOINTS = "joints"  # of a group
ACTION_PARAMETER = "joint_trajectory_action"  # of a group


def group_prefixes(descriptor: RobotDescriptor) -> dict[str, str]:
    """Return what precedes a parameter of each joint group: nothing where none is named."""
    return {name: f"{name}." if descriptor.groups else "" for name in descriptor.joint_groups}


def default_action(descriptor: RobotDescriptor, group: str) -> str:
    """Return the action of a group without a parameter; "" where no group is named."""
    return f"{group}_controller/follow_joint_trajectory" if descriptor.groups else ""
