"""Robot descriptors: models, and their loading from files."""

from robotd.descriptor.drive_settings import DriveSettings, OmnidirectionalDrive, SteeringAxis
from robotd.descriptor.io_settings import GripperSettings, IoAddress
from robotd.descriptor.joint_settings import JointSettings, JointType
from robotd.descriptor.load import (
    RobotSummary,
    list_robots,
    load_robot_descriptor,
    validate_section,
)
from robotd.descriptor.model import (
    CycleSettings,
    EngineSettings,
    RobotDescriptor,
    TrajectorySettings,
)
from robotd.descriptor.overrides import Override, override, parse_override
from robotd.descriptor.search_path import default_search_path

__all__ = [
    "CycleSettings",
    "DriveSettings",
    "EngineSettings",
    "GripperSettings",
    "IoAddress",
    "JointSettings",
    "JointType",
    "OmnidirectionalDrive",
    "Override",
    "RobotDescriptor",
    "RobotSummary",
    "SteeringAxis",
    "TrajectorySettings",
    "default_search_path",
    "list_robots",
    "load_robot_descriptor",
    "override",
    "parse_override",
    "validate_section",
]
