"""Robot descriptors made from a URDF."""

from robotd.descriptor.from_urdf.joint_roles import Choices
from robotd.descriptor.from_urdf.robot_files import bus_robot_files, robot_files

__all__ = ["Choices", "bus_robot_files", "robot_files"]
