from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from tests.features.harness import Observed

from robotd.clock import MonotonicClock, wait_until
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.errors import OperationError
from robotd.feature_host import FeatureHost
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_recorder import continuous_recorder, recorder_process
from robotd_recorder.continuous_recorder import ContinuousRecorder
from robotd_recorder.recorder import open_recorder
from robotd_recorder.recorder_process import RecorderProcess
from robotd_recording.recording_folder import RecordingFolder
from robotd_recording.recording_reader import RecordingError, read_recording
from robotd_recording.recording_repair import recover

CLOCK = MonotonicClock()
WAIT_S = 30.0


@pytest.fixture(autouse=True)
def _not_nice(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that is busy with other tests leaves a nice process nothing for a minute."""
    program = recorder_process.PROGRAM.replace(f", {recorder_process.NICENESS})", ", 0)")
    assert program != recorder_process.PROGRAM
    monkeypatch.setattr(recorder_process, "PROGRAM", program)


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Observed]:
    observed = Observed(tmp_path / "recordings")
    yield observed
    observed.close()


def recorder_of(arm: Observed, split_bytes: float = 1e9) -> ContinuousRecorder:
    folder = RecordingFolder(arm.folder, "cr3a", 1, 1e6)
    return ContinuousRecorder(arm.tap, folder, split_bytes, 3600.0)


def test_every_period_between_start_and_stop_is_recorded(arm: Observed) -> None:
    recorder = recorder_of(arm)
    recorder.start()
    first = arm.tap.frames.written
    with arm.goal([0.2] * 6, 2.0):
        arm.step(2.5)
    report = recorder.stop()
    assert report.path is not None
    recording = read_recording(report.path)
    assert report.size_bytes == report.path.stat().st_size
    written = arm.tap.frames.since(first)[0]
    np.testing.assert_array_equal(recording.frames["values"], written["values"])
    np.testing.assert_array_equal(recording.frames["start_ns"], written["start_ns"])
    assert len(recording.goals) == 1


def test_a_long_recording_is_split_by_size(arm: Observed) -> None:
    recorder = recorder_of(arm, split_bytes=30e3)
    recorder.start()
    for _ in range(4):
        with arm.goal([0.2] * 6, 1.0):
            arm.step(1.2)
        size = recorder.report.size_bytes
        assert wait_until(lambda size=size: recorder.report.size_bytes > size, WAIT_S, CLOCK)
    recorder.stop()
    frames = [read_recording(path).frames for path in arm.files()]
    assert len(frames) > 1
    starts = sorted(np.concatenate([frame["start_ns"] for frame in frames]).tolist())
    assert len(starts) == len(set(starts)) >= 4 * 600


def test_only_one_recording_runs_at_a_time(arm: Observed) -> None:
    recorder = recorder_of(arm)
    with pytest.raises(OperationError, match="nothing is being recorded"):
        recorder.stop()
    recorder.start()
    with pytest.raises(OperationError, match="already recording"):
        recorder.start()
    recorder.stop()
    recorder.start()
    recorder.close()
    assert len(arm.files()) == 2


def test_a_writing_process_that_is_killed_leaves_a_file_that_can_be_recovered(
    arm: Observed,
) -> None:
    others = {*_children()}  # of earlier tests, such as a tracker of shared memory
    recorder = recorder_of(arm)
    recorder.start()
    for _ in range(4):
        with arm.goal([0.2] * 6, 1.0):
            arm.step(1.2)
        size = recorder.report.size_bytes
        assert wait_until(lambda size=size: recorder.report.size_bytes > size, WAIT_S, CLOCK)
    (path,) = arm.files()
    assert wait_until(lambda: path.stat().st_size > 100e3, WAIT_S, CLOCK)
    (child,) = {*_children()} - others
    os.kill(child, signal.SIGKILL)
    assert wait_until(lambda: not recorder.is_recording, WAIT_S, CLOCK)
    with pytest.raises(OperationError, match="the recording ended early"):
        recorder.stop()
    with pytest.raises(RecordingError, match="robotd record --recover"):
        read_recording(path)
    found = recover(path)
    assert found.damaged.exists()
    frames = read_recording(path).frames
    assert len(frames) > 500
    written = arm.tap.frames.since(0)[0]
    held = np.isin(written["start_ns"], frames["start_ns"])
    np.testing.assert_array_equal(
        written["values"][held], frames["values"][np.isin(frames["start_ns"], written["start_ns"])]
    )


def test_a_recording_whose_process_hangs_is_not_reported_as_complete(
    arm: Observed, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = {*_children()}
    recorder = recorder_of(arm)
    recorder.start()
    assert wait_until(lambda: recorder.report.size_bytes > 0, WAIT_S, CLOCK)
    (child,) = {*_children()} - others
    os.kill(child, signal.SIGSTOP)
    try:
        monkeypatch.setattr(continuous_recorder, "END_TIMEOUT_S", 0.1)
        with pytest.raises(OperationError, match=r"the recording is not complete after 0\.1 s"):
            recorder.stop()
    finally:
        os.kill(child, signal.SIGCONT)
    assert wait_until(lambda: not recorder.is_recording, WAIT_S, CLOCK)


def test_a_process_that_waits_for_a_processor_completes_its_file(
    arm: Observed, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = {*_children()}
    monkeypatch.setattr(RecorderProcess, "_queued_s", lambda _: time.monotonic())
    monkeypatch.setattr(recorder_process, "PATIENCE", 10.0 * WAIT_S)
    folder = RecordingFolder(arm.folder, "cr3a", 1, 1e6)
    with RecorderProcess(arm.tap, folder, "request", None) as process:
        (child,) = {*_children()} - others
        os.kill(child, signal.SIGSTOP)
        goes_on = threading.Timer(0.5, os.kill, (child, signal.SIGCONT))
        goes_on.start()
        report = process.finish(0.1)
    goes_on.join()
    assert report.is_last
    assert report.path is not None


def test_a_process_that_ends_late_is_reaped_then(
    arm: Observed, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = {*_children()}
    monkeypatch.setattr(recorder_process, "END_S", 0.01)
    with RecorderProcess(arm.tap, RecordingFolder(arm.folder, "cr3a", 1, 1e6), "request", None):
        (child,) = {*_children()} - others
        os.kill(child, signal.SIGSTOP)
    assert child in _children()
    os.kill(child, signal.SIGCONT)
    assert wait_until(lambda: child not in _children(), WAIT_S, CLOCK)


def _children() -> list[int]:
    found: list[int] = []
    for children in Path("/proc/self/task").glob("*/children"):
        with suppress(OSError):  # the thread has ended meanwhile
            found += map(int, children.read_text().split())
    return found


def test_a_folder_that_nobody_can_make_ends_the_start() -> None:
    folder = "/proc/nowhere"
    descriptor = load_robot_descriptor("cr3a", overrides=[parse_override(f"record={folder}")])
    robot = Robot(descriptor, load_backend("sim"), CLOCK)
    host = FeatureHost(robot, (), "/", print)
    expected = f"nothing can be recorded to {folder}: No such file or directory"
    with pytest.raises(OperationError, match=expected), open_recorder(host):
        pass
