"""Joint states in MCAP files: recordings of robotd, and those of ``ros2 bag record -s mcap``."""

from __future__ import annotations

import json
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, InvalidArgument, RecordingError
from robotd_messages.message_encoders import (
    JOINT_STATE,
    SCHEMAS,
    joint_state,
    qos_profiles,
    read_joint_state,
)
from robotd_recording.mcap_files import open_mcap
from robotd_recording.recording_writer import INFO, JOINT_STATES
from robotd_teach.joint_motion_file import FileMotion

Messages = list[tuple[int, bytes]]  # time and content


def read_joint_states(
    path: Path,
    robot: str,
    joints: Sequence[str],
    topic: str = "",
    begin_s: float = 0.0,
    end_s: float = np.inf,
) -> FileMotion:
    """Return the positions of joints in a file. Any thread.

    Args:
        path: an MCAP file.
        robot: name of the robot that a recording of robotd must be of.
        joints: in the order of the positions. A message without one of them does not count.
        topic: of type ``sensor_msgs/msg/JointState``; "": ``/joint_states``, or the only one.
        begin_s, end_s: part of the time from the first message on.

    Raises:
        RecordingError: no MCAP file, a damaged one, or one of another robot.
        InvalidArgument: no such topic, or no message has all of the joints.
    """
    origin, topics = _messages(path)
    if origin and origin != robot:
        raise RecordingError(f"{path}: recorded on the robot {origin}, this one is {robot}")
    chosen = topic or (JOINT_STATES if JOINT_STATES in topics or not topics else "")
    if not chosen and len(topics) == 1:
        (chosen,) = topics
    if chosen not in topics:
        known = ", ".join(sorted(topics)) or "none"
        text = f"no topic {chosen!r} of joint states" if chosen else "several topics: name one"
        raise InvalidArgument(f"{path}: {text} (available: {known})")
    messages = sorted(topics[chosen], key=lambda message: message[0])
    origin_ns = messages[0][0]
    begin_ns, end_ns = (origin_ns + at_s * NANOSECONDS for at_s in (begin_s, end_s))
    part = [message for message in messages if begin_ns <= message[0] <= end_ns]
    found: set[str] = set()
    times_ns: list[tuple[int, int]] = []
    rows: list[list[float]] = []
    for log_ns, data in part:
        try:
            stamp_ns, state = read_joint_state(data)
        except ValueError as error:
            raise RecordingError(f"{path}: {chosen}: {error}") from error
        found |= state.keys()
        row = [state.get(joint, np.nan) for joint in joints]
        if np.isfinite(row).all():
            times_ns.append((stamp_ns, log_ns))
            rows.append(row)
    if part and (missing := [joint for joint in joints if joint not in found]):
        text = f"{chosen} has no joint {', '.join(missing)}"
        raise InvalidArgument(f"{path}: {text} (available: {', '.join(sorted(found)) or 'none'})")
    if not rows:
        raise InvalidArgument(f"{path}: no positions in this part of its time")
    stamps_ns, logs_ns = np.array(times_ns, np.int64).T
    # Stamps have less jitter, and may be of another clock than the log, or left out.
    own_ns = stamps_ns if (stamps_ns > 0).all() else logs_ns
    later = np.diff(np.maximum.accumulate(own_ns), prepend=-1) > 0
    times_s = (own_ns[later] - own_ns[0] + logs_ns[0] - origin_ns) / NANOSECONDS
    return FileMotion(str(path), times_s, np.array(rows)[later])


def _messages(path: Path) -> tuple[str, dict[str, Messages]]:
    """Return the robot of a recording, "" in a file of others, and joint states by topic."""
    from mcap.records import Channel, Message, Metadata, Schema

    from robotd_recording.mcap_records import read_records

    origin, schemas = "", set[int]()
    topics: dict[str, Messages] = defaultdict(list)
    channels: dict[int, Messages] = {}
    with open_mcap(path, "a recording of joint states") as stream:
        for record in read_records(path, stream):
            match record:
                case Message() if record.channel_id in channels:
                    channels[record.channel_id].append((record.log_time, record.data))
                case Schema() if record.name == JOINT_STATE:
                    schemas.add(record.id)
                case Channel() if record.schema_id in schemas:
                    channels[record.id] = topics[record.topic]
                case Metadata() if record.name == INFO:
                    origin = str(json.loads(record.metadata["robot"]))
    return origin, {topic: messages for topic, messages in topics.items() if messages}


def write_joint_states(
    path: Path, joints: Sequence[str], times_s: FloatArray, positions: FloatArray
) -> None:
    """Write positions (k, n) at times (k,) as messages of ``/joint_states``, from now on.

    Raises OSError: the file exists, or cannot be written; then there is none.
    """
    from mcap.writer import CompressionType, Writer

    path.parent.mkdir(parents=True, exist_ok=True)
    stamps_ns = time.time_ns() + np.round(times_s * NANOSECONDS).astype(np.int64)
    messages = joint_state(joints, 1).encode(stamps_ns, positions)
    with path.open("xb") as stream:
        try:
            writer = Writer(stream, compression=CompressionType.ZSTD)
            writer.start(profile="ros2", library="robotd path export")
            schema = writer.register_schema(JOINT_STATE, "ros2msg", SCHEMAS[JOINT_STATE].encode())
            profiles = {"offered_qos_profiles": qos_profiles(latched=False)}
            channel = writer.register_channel(JOINT_STATES, "cdr", schema, profiles)
            for stamp_ns, data in zip(stamps_ns.tolist(), messages, strict=True):
                writer.add_message(channel, stamp_ns, data, stamp_ns)
            writer.finish()
        except BaseException:
            path.unlink()
            raise
