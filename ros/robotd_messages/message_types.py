"""Definitions of the ROS 2 messages in a recording, in the format ``ros2msg`` of MCAP."""

from __future__ import annotations

_SEPARATOR = "=" * 80 + "\n"
_HEADER = "std_msgs/Header header\n"
_HEADER_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
}
_ARRAY_PARTS = {
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
}


def _schema(text: str, parts: dict[str, str]) -> str:
    return text + "".join(f"{_SEPARATOR}MSG: {name}\n{part}" for name, part in parts.items())


JOINT_STATE = "sensor_msgs/msg/JointState"
DYNAMIC_JOINT_STATE = "control_msgs/msg/DynamicJointState"
LOG = "rcl_interfaces/msg/Log"
OCTETS = "std_msgs/msg/UInt8MultiArray"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
STRING = "std_msgs/msg/String"

SCHEMAS = {
    JOINT_STATE: _schema(
        f"{_HEADER}string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        _HEADER_PARTS,
    ),
    DYNAMIC_JOINT_STATE: _schema(
        f"{_HEADER}string[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n",
        {
            **_HEADER_PARTS,
            "control_msgs/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
        },
    ),
    LOG: _schema(
        "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n"
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n"
        "string function\nuint32 line\n",
        {"builtin_interfaces/Time": _HEADER_PARTS["builtin_interfaces/Time"]},
    ),
    OCTETS: _schema("std_msgs/MultiArrayLayout layout\nuint8[] data\n", _ARRAY_PARTS),
    TRAJECTORY: _schema(
        f"{_HEADER}string[] joint_names\ntrajectory_msgs/JointTrajectoryPoint[] points\n",
        {
            **_HEADER_PARTS,
            "trajectory_msgs/JointTrajectoryPoint": "float64[] positions\nfloat64[] velocities\n"
            "float64[] accelerations\nfloat64[] effort\n"
            "builtin_interfaces/Duration time_from_start\n",
            "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec\n",
        },
    ),
    COMPRESSED_IMAGE: _schema(f"{_HEADER}string format\nuint8[] data\n", _HEADER_PARTS),
    STRING: "string data\n",
}


def qos_profiles(*, latched: bool) -> str:
    """Return ``offered_qos_profiles`` of a channel, as rosbag2 of Jazzy reads them (YAML)."""
    durability = "transient_local" if latched else "volatile"
    return f"""- history: keep_last
  depth: {1 if latched else 10}
  reliability: reliable
  durability: {durability}
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: automatic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
"""
