"""Robot descriptors made from a URDF."""

from robotd_new_robot.joint_roles import Choices
from robotd_new_robot.robot_files import bus_robot_files, robot_files

__all__ = ["Choices", "bus_robot_files", "robot_files"]
