"""Recordings begin with the inputs, outputs and states in force, and with motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from tests.features.recorder.frames import AXES, INFO, OFFSET_NS, PERIOD_NS, ramp

from robotd.events import Event, EventKind
from robotd.observation.frame_ring import COUNT_BYTES, FrameRing
from robotd.observation.io_sampler import FIELDBUS, INPUTS, OUTPUTS
from robotd_recording.recording_folder import RecordingFolder
from robotd_recording.recording_reader import read_recording
from robotd_recording.recording_writer import EVENTS, create_recording
from robotd_recording.writer_process import Batch, Job, JobWriter

FIRST = 40  # frame of the ring that a file begins with


def log_times(path: Path, topic: str) -> list[tuple[int, int]]:
    """Log time and publish time, without the offset to monotonic time."""
    with path.open("rb") as stream:
        return [
            (message.log_time - OFFSET_NS, message.publish_time - OFFSET_NS)
            for _, _, message in make_reader(stream).iter_messages(topics=[topic])
        ]


def append(ring: FrameRing, frame: np.void) -> None:
    at = COUNT_BYTES + ring.written % ring.capacity * ring.type.itemsize
    ring.memory[at : at + ring.type.itemsize] = frame.tobytes()
    ring.count[0] += 1


def test_older_events_and_inputs_do_not_prolong_a_file(tmp_path: Path) -> None:
    path = tmp_path / "arm.mcap"
    frames = ramp()[FIRST:]
    began_ns = int(frames["start_ns"][0])
    writer = create_recording(path, INFO)
    writer.frames(frames)
    writer.event(Event(2 * PERIOD_NS, EventKind.COMMAND, "servo", "servo on"))
    writer.sample((3 * PERIOD_NS, INPUTS, b"\x01"))
    writer.close()
    assert log_times(path, EVENTS) == [(began_ns, 2 * PERIOD_NS)]
    assert log_times(path, INPUTS) == [(began_ns, 3 * PERIOD_NS)]
    [event] = read_recording(path).events
    assert event.time_ns == 2 * PERIOD_NS
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_start_time == began_ns + OFFSET_NS


def test_every_file_of_a_split_recording_begins_with_what_is_latched(tmp_path: Path) -> None:
    ring = FrameRing(len(AXES), 500.0, 5.0)
    frames = ramp()
    job = Job(
        ring.fd, len(AXES), ring.capacity, 0, INFO, "<robot/>",
        RecordingFolder(tmp_path, "arm", 20, 1e9), "record", split_bytes=1.0,
    )  # fmt: skip
    recorder = JobWriter(job)
    stop = Event(PERIOD_NS, EventKind.STOP, "stop", "all motion stopped: test")
    samples = [
        (PERIOD_NS, INPUTS, b"\x05"),
        (PERIOD_NS, OUTPUTS, b"\x02"),
        (PERIOD_NS, FIELDBUS, {"bus0": {"state": 4.0}}),
    ]
    paths = []
    for part, batch in ((frames[:50], Batch([stop], samples)), (frames[50:], Batch([], []))):
        for frame in part:
            append(ring, frame)
        recorder.write(batch)
        paths.append(recorder.report.path)
    recorder.close()
    assert paths[0] != paths[1]
    for path in paths:
        assert path is not None
        recording = read_recording(path)
        assert [data for _, data in recording.inputs] == [b"\x05"]
        assert [data for _, data in recording.outputs] == [b"\x02"]
        assert [event.text for event in recording.events] == [stop.text]
        assert len(log_times(path, FIELDBUS)) == 1
