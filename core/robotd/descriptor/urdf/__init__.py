"""URDF files: reading with every error at once, and the kinematic tree."""

from robotd.descriptor.urdf.joint_frames import JointFrames, transform_numbers
from robotd.descriptor.urdf.urdf_model import UrdfJoint, UrdfLink, UrdfRobot
from robotd.descriptor.urdf.urdf_reader import parse_urdf, read_urdf

__all__ = [
    "JointFrames",
    "UrdfJoint",
    "UrdfLink",
    "UrdfRobot",
    "parse_urdf",
    "read_urdf",
    "transform_numbers",
]
