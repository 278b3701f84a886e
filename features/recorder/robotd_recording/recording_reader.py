"""Reader of a recording: frames of the control loop, events, goals and I/O."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, IntArray, RecordingError
from robotd.api.features import INPUTS, NUMBERS, OUTPUTS, Event, Frames, frame_type
from robotd_messages.message_encoders import (
    LOOP_VALUES,
    MessageTemplate,
    read_log_message,
    read_octets_message,
    read_trajectory_message,
)
from robotd_recording import recording_writer as topics
from robotd_recording.mcap_files import open_mcap
from robotd_recording.recording_writer import INFO, RecordingInfo, templates_of

WANTED = {
    topics.LOOP,
    topics.COMMANDS,
    topics.JOINT_STATES,
    topics.SETPOINTS,
    topics.AXIS_STATES,
    topics.EVENTS,
    topics.GOALS,
    INPUTS,
    OUTPUTS,
}


@dataclass(frozen=True, eq=False)
class Recording:
    """Content of a recording; times are monotonic, of the robot's clock.

    Attributes:
        path: the file.
        info: origin.
        frames: as in ``FrameRing``; every period that was recorded, in the order of time.
        events: in the order of time.
        goals: time and trajectory of each goal: joints, times_s, positions, velocities, ...
        inputs, outputs: time and content of each change.
    """

    path: Path
    info: RecordingInfo
    frames: Frames
    events: tuple[Event, ...]
    goals: tuple[tuple[int, dict[str, Any]], ...]
    inputs: tuple[tuple[int, bytes], ...]
    outputs: tuple[tuple[int, bytes], ...]

    @property
    def start_ns(self) -> int:
        """Time of the first frame; 0 without one."""
        return int(self.frames["start_ns"][0]) if len(self.frames) else 0

    @property
    def duration_s(self) -> float:
        """Time from the first frame to the last."""
        if len(self.frames) < 2:
            return 0.0
        return float(self.frames["start_ns"][-1] - self.frames["start_ns"][0]) / NANOSECONDS


def read_recording(path: Path) -> Recording:
    """Read a recording of robotd whole.

    Raises RecordingError: no such file, another file, one that exceeds a limit, or one that is
    damaged or was not closed: then the text names the command that repairs it.
    """
    with open_mcap(path, "a recording of robotd") as stream:
        return _read(path, stream)


def _read(path: Path, stream: IO[bytes]) -> Recording:
    from mcap.records import Channel, Message, Metadata

    from robotd_recording.mcap_records import max_content_bytes, read_records

    info: dict[str, str] | None = None
    wanted: dict[int, list[tuple[int, bytes]]] = {}
    messages: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    for record in read_records(path, stream):
        match record:
            case Message() if record.channel_id in wanted:
                wanted[record.channel_id].append((record.log_time, record.data))
            case Channel() if record.topic in WANTED:
                wanted[record.id] = messages[record.topic]
            case Metadata() if record.name == INFO and info is None:
                info = record.metadata
    if info is None:
        raise ValueError("it has no metadata of robotd")
    origin = RecordingInfo.of_metadata(info)
    for topic, found in messages.items():
        found.sort(key=lambda message: message[0])
        messages[topic] = [(log_time - origin.offset_ns, data) for log_time, data in found]
    size = len(messages[topics.LOOP]) * frame_type(len(origin.axes)).itemsize
    if size > (limit := max_content_bytes(stream)):
        text = f"its periods take {size / 2**20:.0f} MiB, the limit is {limit / 2**20:.0f} MiB"
        raise RecordingError(f"{path}: {text}")
    return Recording(
        path,
        origin,
        _frames(origin, messages),
        tuple(
            # By their own time: those that are older than the file are logged at its start.
            sorted(
                (read_log_message(data, origin.offset_ns) for _, data in messages[topics.EVENTS]),
                key=lambda event: event.time_ns,
            )
        ),
        tuple((t, read_trajectory_message(data)) for t, data in messages[topics.GOALS]),
        tuple((t, read_octets_message(data)) for t, data in messages[INPUTS]),
        tuple((t, read_octets_message(data)) for t, data in messages[OUTPUTS]),
    )


class _Columns:
    """Decoded messages of one topic: times, stamps and fields."""

    def __init__(self, template: MessageTemplate, messages: Sequence[tuple[int, bytes]]) -> None:
        self.times: IntArray = np.array([time for time, _ in messages], np.int64)
        self.stamps, self.fields = template.decode([data for _, data in messages])

    def rows(self, times: IntArray) -> tuple[Any, Any]:
        """Return indices of frames and of messages with the same time."""
        _, frames, found = np.intersect1d(times, self.times, return_indices=True)
        return frames, found


def _frames(info: RecordingInfo, messages: dict[str, list[tuple[int, bytes]]]) -> Frames:
    templates = templates_of(info)
    decoded = {
        topic: _Columns(templates[topic], messages[topic]) for topic in templates if messages[topic]
    }
    if topics.LOOP not in decoded:
        return np.zeros(0, frame_type(len(info.axes)))
    loop = decoded[topics.LOOP]
    frames: Frames = np.zeros(len(loop.times), frame_type(len(info.axes)))
    frames["start_ns"] = loop.times
    for name, column in zip(LOOP_VALUES, loop.fields[0].T, strict=True):
        frames[name] = column.astype(np.int64)
    frames["values"] = frames["setpoint"] = np.nan
    _fill(frames, decoded.get(topics.COMMANDS), "values", 0, "stamp_ns", info.offset_ns)
    _fill(frames, decoded.get(topics.JOINT_STATES), "values", 2, "stamp_ns", info.offset_ns)
    _fill_gripper(frames, decoded.get(topics.JOINT_STATES), info)
    _fill(frames, decoded.get(topics.SETPOINTS), "setpoint", 0, "due_ns", info.offset_ns)
    _fill_states(frames, decoded.get(topics.AXIS_STATES))
    return frames


def _fill(
    frames: Frames, columns: _Columns | None, block: str, first: int, stamp: str, offset_ns: int
) -> None:
    if columns is None:
        return
    at, found = columns.rows(frames["start_ns"])
    frames[stamp][at] = columns.stamps[found] - offset_ns
    for row, values in enumerate(columns.fields, first):
        frames[block][at, row] = values[found, : frames[block].shape[2]]


def _fill_gripper(frames: Frames, columns: _Columns | None, info: RecordingInfo) -> None:
    """Fill how far the gripper is closed, from the finger with the longest travel."""
    if columns is None or not info.fingers:
        return
    at, found = columns.rows(frames["start_ns"])
    opened, closed = np.array([*info.fingers.values()]).T
    finger = int(np.argmax(np.abs(closed - opened)))
    positions = columns.fields[0][found, len(info.axes) + finger]
    share = (positions - opened[finger]) / (closed[finger] - opened[finger])
    frames["closed_ppm"][at] = np.round(share * 1e6)


def _fill_states(frames: Frames, columns: _Columns | None) -> None:
    """Fill numbers and flags; they hold until the next message."""
    if columns is None:
        return
    latest = np.searchsorted(columns.times, frames["start_ns"], side="right") - 1
    states: FloatArray = np.stack(columns.fields, axis=2)[np.maximum(latest, 0)]
    frames["numbers"] = states[:, : len(NUMBERS)]
    frames["flags"] = states[:, len(NUMBERS) :] != 0
