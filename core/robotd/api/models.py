"""Names for programs that read or write the files of robots.

``load_robot_descriptor`` reads a robot's file and reports every mistake with file and line.
``read_urdf`` does the same with a URDF; a ``UrdfRobot`` is the tree of its links and joints, and
``JointFrames`` their poses. Nothing here needs a backend. ``robotd_export`` is an example.
"""

from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd.descriptor import (
        DriveSettings,
        JointSettings,
        JointType,
        Override,
        RobotDescriptor,
        default_search_path,
        list_robots,
        load_robot_descriptor,
        parse_override,
        validate_section,
    )
    from robotd.descriptor.files import beside, is_file, read_limited
    from robotd.descriptor.group_settings import ALL_JOINTS
    from robotd.descriptor.section import MAX_AXES, NAME
    from robotd.descriptor.urdf import (
        JointFrames,
        UrdfJoint,
        UrdfLink,
        UrdfRobot,
        parse_urdf,
        read_urdf,
        read_urdf_text,
        transform_numbers,
        urdf_text,
    )
    from robotd.descriptor.urdf.package_files import (
        find_mesh,
        mesh_files,
        mesh_names,
        package_folders,
    )
    from robotd.descriptor.urdf.urdf_model import frame
    from robotd.descriptor.urdf.urdf_text import MAX_URDF_BYTES, is_xacro, xml_root
    from robotd.descriptor.validation_errors import validate
    from robotd.descriptor.yaml_tree import YamlNode, parse_yaml, read_yaml
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ALL_JOINTS",
    "MAX_AXES",
    "MAX_URDF_BYTES",
    "NAME",
    "DriveSettings",
    "JointFrames",
    "JointSettings",
    "JointType",
    "Override",
    "RobotDescriptor",
    "UrdfJoint",
    "UrdfLink",
    "UrdfRobot",
    "YamlNode",
    "beside",
    "default_search_path",
    "find_mesh",
    "frame",
    "is_file",
    "is_xacro",
    "list_robots",
    "load_robot_descriptor",
    "mesh_files",
    "mesh_names",
    "package_folders",
    "parse_override",
    "parse_urdf",
    "parse_yaml",
    "read_limited",
    "read_urdf",
    "read_urdf_text",
    "read_yaml",
    "transform_numbers",
    "urdf_text",
    "validate",
    "validate_section",
    "xml_root",
]
