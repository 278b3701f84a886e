"""Writing process of a recording, whose robot dies before the file is written."""

from __future__ import annotations

from multiprocessing import Pipe
from pathlib import Path

import pytest
from tests.features.recorder.frames import AXES, INFO, PERIOD_NS, write_frame

from robotd.device.process_image import ProcessImage
from robotd.events import Event, EventKind
from robotd.observation.frame_ring import FrameRing
from robotd_recording.recording_folder import RecordingFolder
from robotd_recording.recording_reader import read_recording
from robotd_recording.writer_process import Batch, Job, run


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
