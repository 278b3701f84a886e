"""Writing process of a recording, whose robot dies before the file is written."""

from __future__ import annotations

from multiprocessing import Pipe
from pathlib import Path

import pytest
from tests.features.recorder.frames import AXES, INFO, OFFSET_NS, PERIOD_NS, write_frame

from robotd.device.process_image import ProcessImage
from robotd.events import Event, EventKind
from robotd.observation.frame_ring import FrameRing
from robotd_recording.recording_folder import RecordingFolder
from robotd_recording.recording_reader import read_recording
from robotd_recording.writer_process import Batch, Job, JobWriter, run


@pytest.mark.parametrize("split_bytes", [None, 1e9], ids=["flight", "continuous"])
def test_the_file_is_complete_when_the_robot_has_died(
    tmp_path: Path, split_bytes: float | None
) -> None:
    image = ProcessImage(len(AXES))
    ring = FrameRing(image.axes, 500.0, 10.0)
    for period in range(1, 101):
        write_frame(ring, image, start_ns=period * PERIOD_NS)
    folder = RecordingFolder(tmp_path, "arm", 3, 1e6)
    fd, capacity = ring.fd, ring.capacity
    job = Job(fd, image.axes, capacity, 0, INFO, "<robot/>", folder, "fault", split_bytes)
    robot, writer = Pipe()
    robot.send(job)
    for number in range(2):
        event = Event(number * PERIOD_NS, EventKind.MARK, "test", f"event {number}")
        robot.send(Batch([event], []))
    robot.close()
    with pytest.raises(BrokenPipeError):  # of the last report
        run(writer)
    [file] = tmp_path.iterdir()
    recording = read_recording(file)
    assert len(recording.frames) == 100
    assert [event.text for event in recording.events] == ["event 0", "event 1"]


def test_a_file_that_begins_after_the_clock_was_set_has_the_new_time(tmp_path: Path) -> None:
    image = ProcessImage(len(AXES))
    ring = FrameRing(image.axes, 500.0, 10.0)
    folder = RecordingFolder(tmp_path, "arm", 3, 1e6)
    job = Job(ring.fd, image.axes, ring.capacity, 0, INFO, "", folder, "record", split_bytes=1.0)
    recorder, offsets_ns, found = JobWriter(job), [OFFSET_NS, OFFSET_NS + 10**15], []
    for period, offset_ns in enumerate(offsets_ns, 1):
        write_frame(ring, image, start_ns=period * PERIOD_NS)
        recorder.write(Batch(offset_ns=offset_ns))
        path = recorder.report.path
        assert path is not None
        found.append(read_recording(path))
    assert [recording.info.offset_ns for recording in found] == offsets_ns
    assert [recording.start_ns for recording in found] == [PERIOD_NS, 2 * PERIOD_NS]
