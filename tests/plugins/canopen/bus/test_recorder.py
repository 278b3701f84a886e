"""The flight recorder on CANopen drives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig
from tests.plugins.canopen.bus.drives_process import RATE_HZ

from robotd.events import EventKind, sent_by
from robotd.observation.tap import Tap
from robotd.robot import Robot
from robotd_recorder.explanation import explain
from robotd_recorder.recorder import FlightRecorder
from robotd_recording.recording_folder import RecordingFolder
from robotd_recording.recording_reader import read_recording
from robotd_recording.recording_writer import FIELDBUS


def test_a_fault_of_a_drive_is_recorded_with_its_emergency(
    open_rig: OpenRig, tmp_path: Path
) -> None:
    taps: list[Tap] = []

    def observe(robot: Robot) -> None:
        taps.append(Tap(robot, 30.0))

    with open_rig(SMALL, prepare=observe) as harness, taps[0] as tap:
        robot = harness.robot
        kept = RecordingFolder(tmp_path, robot.descriptor.name, 3, 100e6)
        flight = FlightRecorder(tap, kept, 0.1)
        with (
            sent_by("/move_group"),
            robot.follower.follow(harness.request(2.0, 1.0)) as execution,
        ):
            harness.until(lambda: harness.image.position[0] > 0.2)
            harness.inject("2 trip 0x3210")
            assert execution.wait(10.0)
        harness.until(
            lambda: any(event.kind is EventKind.FAULT for event in tap.events.since(0)[0])
        )
        recording = read_recording(flight.snapshot("test"))
    frames = recording.frames
    moved = np.nanmax(frames["values"][:, 2, 0]) - np.nanmin(frames["values"][:, 2, 0])
    assert moved > 0.2
    assert (np.diff(frames["start_ns"]) > 0).all()
    assert np.median(np.diff(frames["stamp_ns"])) == 1e9 / RATE_HZ
    assert frames["numbers"][-1, 0, 1] == 0x3210
    assert np.isfinite(frames["setpoint"][:, 0, 0]).any()  # what was sent to the drive
    assert FIELDBUS in {topic for _, topic, _ in tap.samples.since(0)[0]}
    text = "\n".join(explain(recording, []))
    assert "node 2: EMCY 0x3210 DC link over-voltage" in text.partition("Events")[0]
    assert "commanded by /move_group" in text
