"""The flight recorder on the engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from robotd_recorder.recorder import Recorder, observed
from robotd_recording.recording_reader import read_recording
from robotd_recording.recording_writer import FIELDBUS, OUTPUTS

from robotd.events import sent_by
from robotd.robot import Robot, build_robot
from robots import descriptor, eventually, goal


def _live_output(robot: Robot) -> int:
    live = robot.io.live
    assert live is not None
    return int(live[1][0])


def _changes_of_outputs(recorder: Recorder) -> int:
    return sum(topic == OUTPUTS for _, topic, _ in recorder.tap.samples.since(0)[0])


def test_a_goal_on_the_engine_is_recorded_with_its_client(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    robot = build_robot(descriptor(tmp_path), "wmx")
    with observed(robot, flight_folder=folder) as recorder:
        try:
            robot.start(enable=True)
            with sent_by("/move_group"), robot.follower.follow(goal([0.5], 0.2)) as execution:
                assert execution.wait(10.0)
            for level in (True, False):  # shorter than ten samples a second would show
                robot.io.set_output_bit(0, 3, level)
                eventually(lambda wanted=level: _live_output(robot) == 8 * wanted)
            eventually(lambda: _changes_of_outputs(recorder) >= 3)  # also the first image
            recording = read_recording(recorder.flight.snapshot("test"))
        finally:
            robot.shutdown()
    frames = recording.frames
    assert (np.diff(frames["start_ns"]) > 0).all()
    np.testing.assert_allclose(frames["values"][-1, 2], 0.2, atol=1e-3)
    assert np.isfinite(frames["setpoint"][:, 0]).any()
    ((_, points),) = recording.goals
    np.testing.assert_array_equal(points["positions"][-1], [0.2] * 6)
    assert "/move_group" in {event.sender for event in recording.events}
    assert [data[0] for _, data in recording.outputs][-2:] == [8, 0]
    assert FIELDBUS in {topic for _, topic, _ in recorder.tap.samples.since(0)[0]}
