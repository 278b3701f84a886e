"""The files, read by mcap's own reader with the decoder of mcap-ros2-support."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from tests.features.recorder.frames import AXES, INFO, OFFSET_NS, PERIOD_NS, ramp, write

from robotd.events import Event, EventKind, Level
from robotd_messages.message_encoders import SCHEMAS, named_values, octets_message
from robotd_recording import recording_writer as topics
from robotd_recording.recording_reader import RecordingError, read_recording
from robotd_recording.recording_writer import RecordingInfo, create_recording

GOAL = {
    "joints": ["joint1", "joint2"],
    "times_s": np.array([0.5, 1.25]),
    "positions": np.array([[0.1, 0.2], [0.3, 0.4]]),
    "velocities": np.array([[1.0, 2.0], [0.0, 0.0]]),
    "start_ns": 7 * PERIOD_NS,
}


def messages(path: Path, topic: str) -> list[tuple[int, Any]]:
    """Log time and decoded message, by a reader that is not robotd's."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [
            (message.log_time, decoded)
            for _, _, message, decoded in reader.iter_decoded_messages(topics=[topic])
        ]


def nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "a" / "arm.mcap"
    writer = create_recording(path, INFO, "<robot/>")
    writer.frames(ramp()[:40])
    event = Event(
        50 * PERIOD_NS, EventKind.GOAL, "joints", "goal ü", Level.WARNING, "/client", GOAL
    )
    writer.event(event)
    writer.message(topics.INPUTS, 51 * PERIOD_NS, octets_message(b"\x01\xff"))
    counters = named_values(0, {"bus0": {"lost_frames": 3}, "bus0/node1": {"state": 4}})
    writer.message(topics.FIELDBUS, 52 * PERIOD_NS, counters)
    writer.frames(ramp()[40:])
    writer.close()
    return path


def test_measured_values_are_equal_in_every_period(recorded: Path) -> None:
    frames = ramp()
    found = messages(recorded, topics.JOINT_STATES)
    assert len(found) == len(frames) == 100
    for frame, (log_time, message) in zip(frames, found, strict=True):
        assert log_time == frame["start_ns"] + OFFSET_NS
        assert nanoseconds(message.header.stamp) == frame["stamp_ns"] + OFFSET_NS
        assert tuple(message.name) == AXES
        np.testing.assert_array_equal(message.position, frame["values"][2])
        np.testing.assert_array_equal(message.velocity, frame["values"][3])
        np.testing.assert_array_equal(message.effort, frame["values"][4])


def test_joint_states_have_the_fingers_of_the_gripper(tmp_path: Path) -> None:
    path = tmp_path / "arm.mcap"
    info = replace(INFO, fingers={"left": (0.0, 0.02), "right": (0.01, -0.03)})
    frames = ramp()
    frames["closed_ppm"] = np.linspace(0, 1_000_000, len(frames)).astype(int)
    writer = create_recording(path, info)
    writer.frames(frames)
    writer.close()
    found = [message for _, message in messages(path, topics.JOINT_STATES)]
    assert {tuple(state.name) for state in found} == {(*AXES, "left", "right")}
    positions = np.array([state.position for state in found])
    np.testing.assert_array_equal(positions[:, : len(AXES)], frames["values"][:, 2])
    np.testing.assert_allclose(positions[0, len(AXES) :], [0.0, 0.01])
    np.testing.assert_allclose(positions[-1, len(AXES) :], [0.02, -0.03])
    assert np.abs(np.diff(positions[:, len(AXES) :], axis=0)).max() < 1e-3
    assert all(state.velocity[len(AXES) :] == [0.0, 0.0] for state in found)
    assert all(map(math.isnan, found[0].effort[len(AXES) :]))
    read = read_recording(path)
    assert read.info == info
    np.testing.assert_array_equal(read.frames["closed_ppm"], frames["closed_ppm"])
    np.testing.assert_array_equal(read.frames["values"][:, 2], frames["values"][:, 2])


def test_commands_and_setpoints_are_equal(recorded: Path) -> None:
    frames = ramp()
    commands = messages(recorded, topics.COMMANDS)
    setpoints = messages(recorded, topics.SETPOINTS)
    assert (len(commands), len(setpoints)) == (100, 90)  # no setpoint was sent in the first ten
    for frame, (_, message) in zip(frames, commands, strict=True):
        np.testing.assert_array_equal(message.position, frame["values"][0])
        np.testing.assert_array_equal(message.velocity, frame["values"][1])
        assert list(message.effort) == []
    for frame, (_, message) in zip(frames[10:], setpoints, strict=True):
        assert nanoseconds(message.header.stamp) == frame["due_ns"] + OFFSET_NS
        np.testing.assert_array_equal(message.position, frame["setpoint"][0])


def test_axis_states_are_written_when_they_change(recorded: Path) -> None:
    (_, before), (time, after) = messages(recorded, topics.AXIS_STATES)
    assert time == ramp()[50]["start_ns"] + OFFSET_NS
    values = dict(
        zip(
            after.interface_values[1].interface_names, after.interface_values[1].values, strict=True
        )
    )
    assert values["alarm_code"] == 0x8611
    assert values["amp_alarm"] == values["servo_on"] == 1.0
    assert values["offline"] == 0.0
    assert before.interface_values[1].values[0] == 0.0


def test_timing_of_the_loop_is_recorded(recorded: Path) -> None:
    _, message = messages(recorded, topics.LOOP)[7]
    values = dict(
        zip(
            message.interface_values[0].interface_names,
            message.interface_values[0].values,
            strict=True,
        )
    )
    assert values["late_ns"] == 70.0
    assert values["execution_ns"] == 31_000.0
    assert values["missed"] == 3.0


def test_events_are_log_messages_and_goals_trajectories(recorded: Path) -> None:
    ((_, line),) = messages(recorded, topics.EVENTS)
    assert (line.level, line.name, line.msg, line.file) == (30, "goal/joints", "goal ü", "/client")
    assert json.loads(line.function) == {"joints": ["joint1", "joint2"], "start_ns": 7 * PERIOD_NS}
    ((_, goal),) = messages(recorded, topics.GOALS)
    assert nanoseconds(goal.header.stamp) == 7 * PERIOD_NS + OFFSET_NS
    assert list(goal.joint_names) == ["joint1", "joint2"]
    assert [nanoseconds(point.time_from_start) for point in goal.points] == [5 * 10**8, 1250000000]
    assert [list(point.positions) for point in goal.points] == [[0.1, 0.2], [0.3, 0.4]]
    assert [list(point.velocities) for point in goal.points] == [[1.0, 2.0], [0.0, 0.0]]
    assert [list(point.accelerations) for point in goal.points] == [[], []]


def test_io_fieldbus_and_description_are_there(recorded: Path) -> None:
    ((_, inputs),) = messages(recorded, topics.INPUTS)
    assert bytes(inputs.data) == b"\x01\xff"
    ((_, bus),) = messages(recorded, topics.FIELDBUS)
    assert list(bus.joint_names) == ["bus0", "bus0/node1"]
    assert list(bus.interface_values[0].interface_names) == ["lost_frames"]
    assert list(bus.interface_values[0].values) == [3.0]
    ((time_ns, urdf),) = messages(recorded, topics.DESCRIPTION)
    assert urdf.data == "<robot/>"
    assert time_ns == messages(recorded, topics.LOOP)[0][0]  # an older one prolongs the recording


def test_channels_have_what_rosbag2_asks_for(recorded: Path) -> None:
    with recorded.open("rb") as stream:
        reader = make_reader(stream)
        header, summary = reader.get_header(), reader.get_summary()
    assert header.profile == "ros2"
    assert summary is not None
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
        assert schema.data.decode() == SCHEMAS[schema.name]
        (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        latched = channel.topic == topics.DESCRIPTION
        assert profile["durability"] == ("transient_local" if latched else "volatile")
        assert profile["reliability"] == "reliable"


def test_robotd_reads_the_same_frames_back(recorded: Path) -> None:
    recording = read_recording(recorded)
    frames = ramp()
    for name in ("start_ns", "stamp_ns", "fresh_ns", "late_ns", "execution_ns", "missed", "ready"):
        np.testing.assert_array_equal(recording.frames[name], frames[name], err_msg=name)
    for name in ("values", "numbers", "flags"):
        np.testing.assert_array_equal(recording.frames[name], frames[name], err_msg=name)
    np.testing.assert_array_equal(recording.frames["setpoint"][10:], frames["setpoint"][10:])
    np.testing.assert_array_equal(recording.frames["due_ns"], frames["due_ns"])
    assert np.isnan(recording.frames["setpoint"][:10]).all()
    assert recording.info == INFO
    assert math.isclose(recording.duration_s, 0.198)


def test_robotd_reads_events_goals_and_io_back(recorded: Path) -> None:
    recording = read_recording(recorded)
    (event,) = recording.events
    assert (event.time_ns, event.kind, event.level) == (
        50 * PERIOD_NS,
        EventKind.GOAL,
        Level.WARNING,
    )
    assert (event.subject, event.text, event.sender) == ("joints", "goal ü", "/client")
    ((time_ns, goal),) = recording.goals
    assert time_ns == 50 * PERIOD_NS
    for name in ("times_s", "positions", "velocities"):
        np.testing.assert_array_equal(goal[name], GOAL[name])
    assert "accelerations" not in goal
    assert recording.inputs == ((51 * PERIOD_NS, b"\x01\xff"),)


def test_a_file_that_was_not_closed_is_rejected_with_the_command_that_repairs_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "cut.mcap"
    write(path, ramp())
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(RecordingError, match=f"robotd record --recover {path}"):
        read_recording(path)


def test_other_files_are_rejected_with_their_path(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with pytest.raises(RecordingError, match=r"other\.mcap: No such file"):
        read_recording(path)
    path.write_text("text")
    with pytest.raises(RecordingError, match=r"other\.mcap: not a recording") as rejection:
        read_recording(path)
    assert "--recover" not in str(rejection.value)


def test_another_format_is_rejected() -> None:
    with pytest.raises(ValueError, match="recording format 2 is not 1"):
        RecordingInfo.of_metadata({**INFO.to_metadata(), "format": "2"})


def test_a_damaged_chunk_is_rejected_with_the_command_that_repairs_it(tmp_path: Path) -> None:
    path = tmp_path / "damaged.mcap"
    write(path, ramp(1000))
    whole = path.read_bytes()
    chunk = [match.start() for match in re.finditer(rb"\x28\xb5\x2f\xfd", whole)][1]  # of zstd
    for offset in (20, 200, 300):
        data = bytearray(whole)
        data[chunk + offset] ^= 0x10
        path.write_bytes(data)
        with pytest.raises(RecordingError, match=f"robotd record --recover {path}"):
            read_recording(path)


@pytest.mark.parametrize(
    ("key", "text", "reason"),
    [
        ("rate_hz", "0", "rate_hz: Input should be greater than 0"),
        ("axes", "[0.5]", "axes.0: Input should be a valid string"),
        ("limits", '{"joint1": [1, 2]}', "limits.joint1.2: Field required"),
        ("fingers", "null", "fingers: Input should be a valid"),
        ("units", "null", "units: Input should be a valid"),
    ],
)
def test_metadata_with_a_wrong_value_are_no_recording_and_name_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, text: str, reason: str
) -> None:
    metadata = {**INFO.to_metadata(), key: text}
    monkeypatch.setattr(RecordingInfo, "to_metadata", lambda info: metadata)
    write(tmp_path / "x.mcap", ramp())
    with pytest.raises(RecordingError, match=f"x.mcap: not a recording of robotd: {reason}"):
        read_recording(tmp_path / "x.mcap")
