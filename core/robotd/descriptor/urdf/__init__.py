"""URDF files: reading with every error at once, and the kinematic tree."""

from robotd.descriptor.urdf.gravity import STANDARD_GRAVITY, GravityModel
from robotd.descriptor.urdf.joint_frames import JointFrames, transform_numbers
from robotd.descriptor.urdf.urdf_model import UrdfJoint, UrdfLink, UrdfRobot
from robotd.descriptor.urdf.urdf_reader import parse_urdf, read_urdf
from robotd.descriptor.urdf.urdf_text import read_urdf_text, urdf_text

__all__ = [
    "STANDARD_GRAVITY",
    "GravityModel",
    "JointFrames",
    "UrdfJoint",
    "UrdfLink",
    "UrdfRobot",
    "parse_urdf",
    "read_urdf",
    "read_urdf_text",
    "transform_numbers",
    "urdf_text",
]
