"""Writer of a recording: an MCAP file of ROS 2 messages."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from pydantic import PositiveFloat, TypeAdapter, ValidationError

from robotd.api import IntArray
from robotd.api.features import (
    FIELDBUS,
    INPUTS,
    OBJECTS,
    OUTPUTS,
    Event,
    EventKind,
    Frames,
    Sample,
    measured_joints,
)
from robotd.api.models import MAX_AXES
from robotd_messages import message_encoders as types
from robotd_messages.message_encoders import (
    AXIS_VALUES,
    LOOP_VALUES,
    MessageTemplate,
    dynamic_joint_state,
    joint_state,
    jpeg_message,
    log_message,
    named_values,
    octets_message,
    string_message,
    trajectory_message,
)

if TYPE_CHECKING:
    from mcap.writer import Writer

CHUNK_BYTES = 64 * 1024
STATES_PERIOD_NS = 5_000_000_000  # of the axis states while they do not change
INFO = "robotd"  # name of the metadata record
FORMAT = 1

JOINT_STATES = "/joint_states"
COMMANDS = "/robotd/joint_commands"
SETPOINTS = "/robotd/setpoints"
AXIS_STATES = "/robotd/axis_states"
LOOP = "/robotd/control_loop"
EVENTS = "/robotd/events"
GOALS = "/robotd/goals"
DESCRIPTION = "/robot_description"

TOPICS = {
    JOINT_STATES: types.JOINT_STATE,
    COMMANDS: types.JOINT_STATE,
    SETPOINTS: types.JOINT_STATE,
    AXIS_STATES: types.DYNAMIC_JOINT_STATE,
    LOOP: types.DYNAMIC_JOINT_STATE,
    EVENTS: types.LOG,
    GOALS: types.TRAJECTORY,
    INPUTS: types.OCTETS,
    OUTPUTS: types.OCTETS,
    FIELDBUS: types.DYNAMIC_JOINT_STATE,
    OBJECTS: types.DYNAMIC_JOINT_STATE,
    DESCRIPTION: types.STRING,
}
LATCHED = {DESCRIPTION}


@dataclass(frozen=True)
class RecordingInfo:
    """Origin of a recording, in its metadata record ``robotd``.

    Attributes:
        robot, backend, variant, version: names; the version is robotd's.
        cause: event that it was written for; "" for a continuous recording.
        rate_hz: of the control loop.
        axes: names of the axes, in their order.
        joints: axis of each joint, in the order of trajectories.
        limits: of each joint: lower, upper, velocity, acceleration.
        offset_ns: wall-clock time minus monotonic time of the robot's clock.
        format: version of the layout, ``FORMAT``.
        units: of each joint, "rad" or "m"; empty in older files: rad.
        fingers: positions of each finger of the gripper when open and when closed, which
            ``/joint_states`` has after the axes; empty in older files.
        cause_ns: time of the event ``cause``; 0 without one.
    """

    robot: str
    backend: str
    variant: str
    version: str
    cause: str
    rate_hz: PositiveFloat
    axes: tuple[str, ...]
    joints: tuple[int, ...]
    limits: Mapping[str, tuple[float, float, float, float]]
    offset_ns: int
    format: int = FORMAT
    units: Mapping[str, str] = field(default_factory=dict)
    fingers: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    cause_ns: int = 0

    def unit(self, axis: str) -> str:
        """Return "rad" or "m"; an axis that is not a joint has rad."""
        return self.units.get(axis, "rad")

    def to_metadata(self) -> dict[str, str]:
        """Return the values as JSON texts."""
        return {key: json.dumps(value) for key, value in asdict(self).items()}

    @classmethod
    def of_metadata(cls, data: Mapping[str, str]) -> Self:
        """Read the values back. Raises ValueError for another format, or for wrong values."""
        values: dict[str, Any] = {key: json.loads(text) for key, text in data.items()}
        if values.get("format") != FORMAT:
            raise ValueError(f"recording format {values.get('format')} is not {FORMAT}")
        try:
            info = TypeAdapter(cls).validate_python(values)
        except ValidationError as error:
            first = error.errors()[0]
            raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
        if len(info.axes) > MAX_AXES:
            raise ValueError(f"{len(info.axes)} axes, the limit is {MAX_AXES}")
        return info


class Picture(NamedTuple):
    """Picture of a camera of a simulated world, as JPEG."""

    time_ns: int
    camera: str
    jpeg: bytes


class RecordingWriter:
    """Writes one file. One thread, never the control loop.

    Args:
        stream: file opened for binary writing; closed by ``close``.
        info: metadata of the recording.
        urdf: text of the robot's URDF; "" for none.

    Raises OSError: the disk is full or the file cannot be written; also from the other methods.
    """

    def __init__(self, stream: IO[bytes], info: RecordingInfo, urdf: str = "") -> None:
        from mcap.writer import CompressionType, Writer

        self.info = info
        self._stream = stream
        self._offset_ns = info.offset_ns
        self._templates = templates_of(info)
        self._last_due_ns = self._last_stamp_ns = 0
        self._last_states = b""
        self._states_ns = 0
        self._began_ns: int | None = None  # time of the first frame
        self._writer: Writer = Writer(
            stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._writer.start(profile="ros2", library=f"robotd {info.version}")
        self._writer.add_metadata(INFO, info.to_metadata())
        schemas = {name: self._register_schema(name) for name in dict.fromkeys(TOPICS.values())}
        self._channels = {
            topic: self._register(topic, schemas[name]) for topic, name in TOPICS.items()
        }
        self._description = string_message(urdf) if urdf else b""  # until the first message

    @property
    def has_begun(self) -> bool:
        """True once the file has frames."""
        return self._began_ns is not None

    @property
    def size_bytes(self) -> int:
        """Size of the file so far, without the last chunk."""
        return self._stream.tell()

    def frames(self, frames: Frames) -> None:
        """Add frames, in the order of time."""
        if len(frames) == 0:
            return
        start = frames["start_ns"]
        if self._began_ns is None:
            self._began_ns = int(start[0])
        stamps = frames["stamp_ns"]
        known = (stamps > 0) & (stamps != np.concatenate(([self._last_stamp_ns], stamps[:-1])))
        due = frames["due_ns"]
        sent = due != np.concatenate(([self._last_due_ns], due[:-1]))
        self._last_stamp_ns, self._last_due_ns = int(stamps[-1]), int(due[-1])
        position_command, velocity_command = (frames["values"][:, row] for row in (0, 1))
        measured = measured_joints(frames, self.info.fingers)
        loop = np.stack([frames[name].astype(float) for name in LOOP_VALUES], axis=1)
        messages = [
            *self._encoded(JOINT_STATES, start, stamps, known, *measured),
            *self._encoded(COMMANDS, start, stamps, known, position_command, velocity_command),
            *self._encoded(SETPOINTS, start, due, sent & (due > 0), *_rows(frames["setpoint"])),
            *self._states(frames),
            # Behind the others: a frame of a file that was cut off is complete or not there.
            *self._encoded(LOOP, start, start, np.ones(len(start), bool), loop),
        ]
        messages.sort(key=lambda message: message[0])
        for time_ns, topic, data in messages:
            self.message(topic, time_ns, data)

    def event(self, event: Event) -> None:
        """Add an event, with the trajectory of a goal."""
        time_ns = event.time_ns
        self.message(EVENTS, time_ns, log_message(event, time_ns + self._offset_ns))
        if event.kind is EventKind.GOAL and "positions" in event.data:
            start_ns = int(event.data.get("start_ns", time_ns)) + self._offset_ns
            self.message(GOALS, time_ns, trajectory_message(event.data, start_ns))

    def sample(self, sample: Sample) -> None:
        """Add a sample of the I/O, the fieldbus or the objects."""
        time_ns, name, content = sample
        if isinstance(content, bytes):
            self.message(name, time_ns, octets_message(content))
        else:
            self.message(name, time_ns, named_values(time_ns + self._offset_ns, content))

    def picture(self, picture: Picture) -> None:
        """Add a picture; its camera gets a topic with the first one."""
        time_ns, camera, jpeg = picture
        topic = f"/{camera}/image_raw/compressed"
        if topic not in self._channels:
            schema = self._register_schema(types.COMPRESSED_IMAGE)
            self._channels[topic] = self._register(topic, schema)
        self.message(topic, time_ns, jpeg_message(time_ns + self._offset_ns, camera, jpeg))

    def message(self, topic: str, time_ns: int, data: bytes) -> None:
        """Add a message that is encoded already.

        What is older than the first frame, as an input that has not changed since, is logged at
        the time of that frame: players begin with motion. It is published at its own time.
        """
        published = time_ns + self._offset_ns
        log_time = max(time_ns, self._began_ns or time_ns) + self._offset_ns
        if self._description:
            # At the time of the first message: an earlier one would prolong the recording.
            description, self._description = self._description, b""
            self._writer.add_message(self._channels[DESCRIPTION], log_time, description, log_time)
        self._writer.add_message(self._channels[topic], log_time, data, published)

    def flush(self) -> None:
        """Hand the complete chunks to the operating system."""
        self._stream.flush()

    def close(self) -> None:
        """Write the index and close the file."""
        try:
            self._writer.finish()
        finally:
            self._stream.close()

    def _states(self, frames: Frames) -> list[tuple[int, str, bytes]]:
        """Return the axis states where they change, and every ``STATES_PERIOD_NS``."""
        rows = np.concatenate((frames["numbers"], frames["flags"].astype(np.int64)), axis=1)
        chosen = []
        for index, (row, time_ns) in enumerate(zip(rows, frames["start_ns"].tolist(), strict=True)):
            state = row.tobytes()
            if state != self._last_states or time_ns - self._states_ns >= STATES_PERIOD_NS:
                self._last_states, self._states_ns = state, time_ns
                chosen.append(index)
        times = frames["start_ns"][chosen]
        axes = (rows[chosen, :, axis] for axis in range(rows.shape[2]))
        return self._encoded(AXIS_STATES, times, times, np.ones(len(times), bool), *axes)

    def _encoded(
        self, topic: str, times: IntArray, stamps: IntArray, chosen: Any, *fields: Any
    ) -> list[tuple[int, str, bytes]]:
        template = self._templates[topic]
        data = template.encode(
            stamps[chosen] + self._offset_ns, *(values[chosen] for values in fields)
        )
        return [
            (time_ns, topic, message)
            for time_ns, message in zip(times[chosen].tolist(), data, strict=True)
        ]

    def _register_schema(self, name: str) -> int:
        schema = types.SCHEMAS[name].encode()
        return int(self._writer.register_schema(name, "ros2msg", schema))

    def _register(self, topic: str, schema: int) -> int:
        metadata = {"offered_qos_profiles": types.qos_profiles(latched=topic in LATCHED)}
        return int(self._writer.register_channel(topic, "cdr", schema, metadata))


def create_recording(path: Path, info: RecordingInfo, urdf: str = "") -> RecordingWriter:
    """Create the file ``path``, which must not exist, and its folder. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    stream = path.open("xb")
    try:
        return RecordingWriter(stream, info, urdf)
    except BaseException:
        stream.close()
        raise


def templates_of(info: RecordingInfo) -> dict[str, MessageTemplate]:
    """Return the messages of constant size, by topic."""
    axes = info.axes
    return {
        JOINT_STATES: joint_state([*axes, *info.fingers], 3),
        COMMANDS: joint_state(axes, 2),
        SETPOINTS: joint_state(axes, 2),
        AXIS_STATES: dynamic_joint_state(axes, AXIS_VALUES),
        LOOP: dynamic_joint_state(["control_loop"], LOOP_VALUES),
    }


def _rows(block: Any) -> list[Any]:
    return [block[:, row] for row in range(block.shape[1])]
