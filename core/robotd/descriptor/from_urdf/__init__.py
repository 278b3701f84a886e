"""Robot descriptors made from a URDF."""

from robotd.descriptor.from_urdf.joint_roles import Choices
from robotd.descriptor.from_urdf.robot_files import robot_files

__all__ = ["Choices", "robot_files"]
