"""Frames and events of a robot as CDR messages, with their definitions (``ros2msg`` of MCAP)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.device.process_image import FLAGS, NUMBERS
from robotd.events import Event, EventKind, Level
from robotd_messages.cdr_stream import CdrReader, CdrWriter

LEVELS = {Level.DEBUG: 10, Level.INFO: 20, Level.WARNING: 30, Level.ERROR: 40}
AXIS_VALUES = (*NUMBERS, *FLAGS)
LOOP_VALUES = ("late_ns", "execution_ns", "missed", "fresh_ns", "ready")
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


class MessageTemplate:
    """Message of constant size: many of them are encoded and decoded at once.

    Args:
        data: CDR of the message.
        stamp: offset of its time.
        fields: offset and number of float64 values of each field.
    """

    def __init__(self, data: bytes, stamp: int, fields: Sequence[tuple[int, int]]) -> None:
        self.size = len(data)
        self._data = np.frombuffer(data, np.uint8)
        self._stamp = stamp
        self._fields = fields

    def encode(self, stamps_ns: IntArray, *columns: FloatArray) -> list[bytes]:
        """Return one message for each stamp; ``columns`` have the shape (messages, values)."""
        rows = np.tile(self._data, (len(stamps_ns), 1))
        times = np.empty((len(stamps_ns), 2), "<u4")
        times[:, 0], times[:, 1] = np.divmod(stamps_ns, NANOSECONDS)
        rows[:, self._stamp : self._stamp + 8] = _octets(times)
        for (offset, count), values in zip(self._fields, columns, strict=True):
            rows[:, offset : offset + 8 * count] = _octets(np.asarray(values, "<f8"))
        data = rows.tobytes()
        return [data[begin : begin + self.size] for begin in range(0, len(data), self.size)]

    def decode(self, messages: Sequence[bytes]) -> tuple[IntArray, list[FloatArray]]:
        """Return stamps and fields of messages of this size. Raises ValueError for others."""
        if any(len(message) != self.size for message in messages):
            raise ValueError(f"a message does not have {self.size} bytes")
        rows = np.frombuffer(b"".join(messages), np.uint8).reshape(-1, self.size)
        stamp = np.ascontiguousarray(rows[:, self._stamp : self._stamp + 8]).view("<u4")
        times = stamp.astype(np.int64)
        columns = [
            np.ascontiguousarray(rows[:, offset : offset + 8 * count]).view("<f8")
            for offset, count in self._fields
        ]
        return times[:, 0] * NANOSECONDS + times[:, 1], columns


def joint_state(names: Sequence[str], filled: int) -> MessageTemplate:
    """Template of a JointState with the first ``filled`` of position, velocity and effort."""
    writer = CdrWriter()
    stamp = writer.header(0)
    writer.strings(names)
    zeros = [0.0] * len(names)
    places = [(writer.floats(zeros), len(names)) for _ in range(filled)]
    for _ in range(3 - filled):
        writer.floats([])
    return MessageTemplate(writer.payload(), stamp, places)


def read_joint_state(data: bytes) -> tuple[int, dict[str, float]]:
    """Return time in ns and position by joint of a JointState. Raises ValueError."""
    reader = CdrReader(data)
    time_ns, names = reader.header_ns(), reader.strings()
    positions = reader.floats().tolist()
    if positions and len(positions) != len(names):
        raise ValueError(f"{len(positions)} positions of {len(names)} joints")
    return time_ns, dict(zip(names, positions, strict=False))


def dynamic_joint_state(names: Sequence[str], interfaces: Sequence[str]) -> MessageTemplate:
    """Template of a DynamicJointState whose joints all have the same interfaces."""
    writer = CdrWriter()
    stamp = writer.header(0)
    writer.strings(names)
    writer.number("I", len(names))
    places = []
    for _ in names:
        writer.strings(interfaces)
        places.append((writer.floats([0.0] * len(interfaces)), len(interfaces)))
    return MessageTemplate(writer.payload(), stamp, places)


def named_values(time_ns: int, groups: Mapping[str, Mapping[str, float]]) -> bytes:
    """Return a DynamicJointState: numbers by the name of a thing and of the value."""
    writer = CdrWriter()
    writer.header(time_ns)
    writer.strings([*groups])
    writer.number("I", len(groups))
    for values in groups.values():
        writer.strings([*values])
        writer.floats([*values.values()])
    return writer.payload()


def log_message(event: Event, time_ns: int) -> bytes:
    """Return an event as Log: ``name`` is ``kind/subject``, ``file`` the sender.

    ``function`` holds the data as JSON, without arrays; see ``trajectory_message``.
    """
    writer = CdrWriter()
    writer.time(time_ns)
    writer.number("B", LEVELS[event.level])
    writer.string(f"{event.kind}/{event.subject}")
    writer.string(event.text)
    writer.string(event.sender)
    plain = {name: value for name, value in event.data.items() if not isinstance(value, np.ndarray)}
    writer.string(json.dumps(plain, default=_json_value))
    writer.number("I", 0)
    return writer.payload()


def read_log_message(data: bytes, offset_ns: int) -> Event:
    """Return the event of ``log_message``, its time without ``offset_ns``. Raises ValueError."""
    reader = CdrReader(data)
    time_ns = reader.time_ns() - offset_ns
    number = int(reader.number("B"))
    kind, _, subject = reader.string().partition("/")
    text, sender, details = reader.string(), reader.string(), reader.string()
    level = next((level for level, code in LEVELS.items() if code == number), Level.INFO)
    return Event(time_ns, EventKind(kind), subject, text, level, sender, json.loads(details))


def trajectory_message(data: Mapping[str, Any], time_ns: int) -> bytes:
    """Return the trajectory of a goal's data as JointTrajectory, its stamp the start."""
    writer = CdrWriter()
    writer.header(time_ns)
    writer.strings(data["joints"])
    writer.number("I", len(data["times_s"]))
    nothing: list[float] = []
    for index, time_s in enumerate(data["times_s"].tolist()):
        for field in ("positions", "velocities", "accelerations"):
            values = data.get(field)
            writer.floats(nothing if values is None else values[index])
        writer.floats(nothing)  # effort
        writer.time(round(time_s * NANOSECONDS))
    return writer.payload()


def read_trajectory_message(data: bytes) -> dict[str, Any]:
    """Return joints, times_s and positions, velocities, accelerations where given."""
    reader = CdrReader(data)
    reader.header_ns()
    joints = reader.strings()
    rows: dict[str, list[FloatArray]] = {"positions": [], "velocities": [], "accelerations": []}
    times_s = []
    for _ in range(reader.count()):
        for values in rows.values():
            values.append(reader.floats())
        reader.floats()
        times_s.append(reader.time_ns() / NANOSECONDS)
    found = {name: np.array(values) for name, values in rows.items() if values and values[0].size}
    return {"joints": joints, "times_s": np.array(times_s), **found}


def octets_message(data: bytes) -> bytes:
    """Return a UInt8MultiArray."""
    writer = CdrWriter()
    writer.number("I", 0)  # no dimensions
    writer.number("I", 0)  # data_offset
    writer.octets(data)
    return writer.payload()


def read_octets_message(data: bytes) -> bytes:
    """Return the bytes of ``octets_message``."""
    reader = CdrReader(data)
    reader.number("I")
    reader.number("I")
    return reader.octets()


def string_message(text: str) -> bytes:
    """Return a std_msgs/String."""
    writer = CdrWriter()
    writer.string(text)
    return writer.payload()


def jpeg_message(time_ns: int, frame: str, jpeg: bytes) -> bytes:
    """Return a picture in a frame as sensor_msgs/CompressedImage."""
    writer = CdrWriter()
    writer.time(time_ns)
    writer.string(frame)
    writer.string("jpeg")
    writer.octets(jpeg)
    return writer.payload()


def _octets(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the bytes of ``values``, shape (rows, values), as (rows, bytes)."""
    shape = len(values), values.shape[1] * values.itemsize
    return np.ascontiguousarray(values).view(np.uint8).reshape(shape)


def _json_value(value: Any) -> Any:
    """Return a value that JSON knows for one that it does not."""
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, bytes):
        return value.hex()
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    return str(value)
