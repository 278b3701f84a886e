"""Robot descriptors: models, and their loading from files."""

from robotd.descriptor.load import (
    RobotSummary,
    default_search_path,
    list_robots,
    load_robot_descriptor,
    validate_section,
)
from robotd.descriptor.model import (
    CycleSettings,
    DriveSettings,
    EngineSettings,
    GripperSettings,
    JointSettings,
    RobotDescriptor,
    TrajectorySettings,
)
from robotd.descriptor.overrides import Override, parse_override
from robotd.descriptor.wmx_parameters import (
    WmxParameters,
    default_wmx_parameters,
    require_same_scaling,
)
from robotd.descriptor.wmx_xml import axis_text, read_wmx_parameters, write_wmx_parameters

__all__ = [
    "CycleSettings",
    "DriveSettings",
    "EngineSettings",
    "GripperSettings",
    "JointSettings",
    "Override",
    "RobotDescriptor",
    "RobotSummary",
    "TrajectorySettings",
    "WmxParameters",
    "axis_text",
    "default_search_path",
    "default_wmx_parameters",
    "list_robots",
    "load_robot_descriptor",
    "parse_override",
    "read_wmx_parameters",
    "require_same_scaling",
    "validate_section",
    "write_wmx_parameters",
]
