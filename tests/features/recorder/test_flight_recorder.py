from __future__ import annotations

import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.features.harness import Observed

from robotd.api.features import Tap
from robotd.clock import NANOSECONDS, MonotonicClock, wait_until
from robotd.clock.simulated import PacedClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.errors import OperationError
from robotd.events import EventKind, sent_by
from robotd.feature_host import open_features
from robotd.observation.io_sampler import IoSampler
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_recorder import recorder_process
from robotd_recorder.recorder_process import RecorderProcess
from robotd_recording.recording_reader import Recording, read_recording
from robotd_recording.recording_writer import INPUTS

LIMITED = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
"""


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Observed]:
    observed = Observed(tmp_path / "recordings")
    yield observed
    observed.close()


def saved(arm: Observed) -> Recording:
    arm.flight.close()
    (path,) = arm.files()
    assert path == arm.flight.last
    return read_recording(path)


def test_a_drive_alarm_in_a_goal_is_saved_with_cause_and_sender(arm: Observed) -> None:
    with sent_by("/move_group"), arm.goal([0.3] * 6) as execution:
        arm.step(0.4)
        arm.robot.fault_injector.trip(2, 0x8611)
        arm.step(0.3)
        assert execution.completion.done
    arm.step(0.6)
    recording = saved(arm)
    assert "-fault" in recording.path.name
    assert recording.info.cause.startswith("joint3: amplifier alarm 34321")
    kinds = {event.kind: event for event in recording.events}
    assert kinds[EventKind.GOAL].sender == "/move_group"
    assert kinds[EventKind.RESULT].data["outcome"] == "fault"
    fault = kinds[EventKind.FAULT]
    assert (fault.subject, fault.data["code"]) == ("joint3", 0x8611)
    frame = recording.frames[recording.frames["start_ns"] == fault.time_ns][0]
    assert frame["numbers"][0, 2] == 0x8611  # the time of the fault is that of its frame
    after_s = (recording.frames["start_ns"][-1] - fault.time_ns) * 1e-9
    assert after_s >= 0.5
    ((_, goal),) = recording.goals
    np.testing.assert_array_equal(goal["positions"], [[0.3] * 6])


def test_each_fault_has_the_reason_of_its_own_time(arm: Observed) -> None:
    """Both faults are found in one look at the frames, when the reason is another or none."""
    for code in (0x3210, 0x8611):
        arm.robot.fault_injector.trip(2, code)
        arm.robot.step(2)
        arm.robot.axes.clear_alarm(2)
        arm.robot.step(2)
    arm.tap.observe()
    faults = [event.text for event in arm.robot.events.since(0)[0] if event.kind is EventKind.FAULT]
    assert faults == [
        "joint3: amplifier alarm 12816 (DC link over-voltage)",
        "joint3: amplifier alarm 34321 (following error)",
    ]


def test_the_recorded_values_are_those_of_the_image(arm: Observed) -> None:
    image, expected = arm.robot.image, {}
    with arm.goal([0.3] * 6, 0.5):
        for _ in range(250):
            arm.robot.step(1)
            expected[image.stamp_ns] = image.values.copy()
    frames = read_recording(arm.flight.snapshot("test")).frames
    frames = frames[np.isin(frames["stamp_ns"], [*expected])]
    np.testing.assert_array_equal(frames["values"], [*expected.values()])
    assert (np.diff(frames["stamp_ns"]) == 2_000_000).all()
    assert len(frames) == 250


def test_an_input_of_one_period_is_recorded_in_its_period(arm: Observed) -> None:
    injector = arm.robot.fault_injector
    arm.robot.step(7)
    for value in (True, False):
        injector.set_input_bit(1, 3, value)
        arm.robot.step(1)
    arm.robot.io.set_output_bit(0, 2, True)
    arm.step(0.1)
    recording = read_recording(arm.flight.snapshot("test"))
    (rise, risen), (fall, fallen) = recording.inputs[-2:]
    assert (risen[1], fallen[1]) == (8, 0)
    assert fall - rise == 2_000_000
    assert {rise, fall} <= {*recording.frames["start_ns"].tolist()}
    (_, before), (_, after) = recording.outputs[-2:]
    assert (before[0], after[0]) == (0, 4)


def test_a_backend_without_a_live_image_is_sampled(arm: Observed) -> None:
    class Closed:
        live = None
        sizes = (2, 0)
        image = b"\1\0"

        def input_bytes(self, byte: int, length: int) -> bytes:
            return self.image[byte : byte + length]

    io = Closed()
    sampler = IoSampler(io, lambda: 5)  # type: ignore[arg-type]
    assert sampler.live is None
    assert [*sampler.changes()] == [(5, INPUTS, b"\1\0")]
    assert [*sampler.changes()] == []
    io.image = b"\0\1"
    assert [*sampler.changes()] == [(5, INPUTS, b"\0\1")]


def test_commands_of_clients_are_recorded_also_rejected_ones(arm: Observed) -> None:
    with sent_by("/panel"):
        arm.robot.axes.servo(3, False)
        with pytest.raises(OperationError):
            arm.robot.axes.servo(17, True)
    events = read_recording(arm.flight.snapshot("test")).events
    found = [(event.text, event.sender) for event in events if event.sender == "/panel"]
    assert found == [
        ("servo: joint4, off", "/panel"),
        ("servo rejected: axis 17 is outside 0..5", "/panel"),
    ]


def test_nothing_is_saved_without_a_fault(arm: Observed) -> None:
    with arm.goal([0.1] * 6, 0.5) as execution:
        arm.step(0.2)
        execution.cancel()
        arm.step(0.4)
    arm.step(1.0)
    arm.robot.shutdown()
    arm.tap.observe()
    arm.flight.close()
    assert arm.files() == []


def test_a_path_tolerance_violation_and_a_quick_stop_are_saved(arm: Observed) -> None:
    arm.robot.axes.quick_stop([0])
    arm.step(0.6)
    recording = saved(arm)
    assert recording.info.cause == "quick stop: joint1"


def test_old_recordings_are_removed_by_number(arm: Observed) -> None:
    paths = [arm.flight.snapshot("test") for _ in range(4)]
    assert arm.files() == sorted(paths[1:])


def test_a_full_disk_loses_the_recording_and_nothing_else(
    arm: Observed, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = recorder_process.PROGRAM
    monkeypatch.setattr(recorder_process, "PROGRAM", f"{LIMITED}\n{whole}")
    arm.robot.fault_injector.trip(2, 0x8611)
    arm.step(0.8)
    with pytest.raises(OperationError, match="recording was not written: File too large"):
        arm.flight.snapshot("test")
    assert arm.flight.failed == 1  # of the fault
    assert arm.files() == []
    monkeypatch.setattr(recorder_process, "PROGRAM", whole)
    arm.robot.axes.clear_alarm(2)  # the robot goes on
    assert len(read_recording(arm.flight.snapshot("test")).frames) > 100


def test_a_file_name_that_is_no_text_is_recorded(arm: Observed) -> None:
    text = "recording saved file=" + os.fsdecode(b"/home/op\xff")
    arm.tap.events.add(EventKind.LOG, "recorder", text)
    events = read_recording(arm.flight.snapshot("test")).events
    assert "recording saved file=/home/op\\udcff" in [event.text for event in events]


def test_a_writing_process_that_fails_at_the_end_has_not_saved_a_recording(
    arm: Observed, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    fails = "from robotd_recording.writer_process import JobWriter; JobWriter.close = None"
    monkeypatch.setattr(recorder_process, "PROGRAM", f"{fails}\n{recorder_process.PROGRAM}")
    with pytest.raises(OperationError, match="not written: the process that writes it has ended"):
        arm.flight.snapshot("test")
    assert arm.flight.saved == 0
    assert "TypeError" in capfd.readouterr().err


def test_the_writing_process_leaves_the_processor_to_robots_before_it_imports(
    arm: Observed, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    says = (
        "import os, sys; print(os.getpriority(os.PRIO_PROCESS, 0), 'numpy' in sys.modules,"
        " os.getsid(0), os.getpgid(0) == os.getpid())"
    )
    before, word, after = recorder_process.PROGRAM.partition("from robotd_recording")
    monkeypatch.setattr(recorder_process, "PROGRAM", f"{before}{says}\n{word}{after}")
    arm.flight.snapshot("test")
    assert capfd.readouterr().out.split() == ["10", "False", f"{os.getsid(0)}", "True"]


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    observed = Observed(tmp_path / "file" / "recordings")
    with pytest.raises(OperationError, match="Not a directory"):
        observed.flight.snapshot("test")
    observed.close()


@pytest.mark.parametrize(("scale", "passes"), [(2.0, False), (1.0, True)])
def test_simulated_time_faster_than_real_waits_while_a_fault_is_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scale: float, passes: bool
) -> None:
    """Without waiting the memory would be overwritten before the process reads it."""
    passed = list[bool]()

    class LateProcess(RecorderProcess):
        def __init__(self, tap: Tap, *arguments: Any, **named: Any) -> None:
            clock = tap.robot.clock
            end_ns = clock.now_ns() + NANOSECONDS // 10
            passed.append(wait_until(lambda: clock.now_ns() > end_ns, 1.0, MonotonicClock()))
            super().__init__(tap, *arguments, **named)

    monkeypatch.setattr("robotd_recorder.recorder.RecorderProcess", LateProcess)
    values = ["recorder.after_s=0", f"recorder.folder={tmp_path}"]
    descriptor = load_robot_descriptor("cr3a", overrides=[*map(parse_override, values)])
    robot = Robot(descriptor, load_backend("sim"), PacedClock(scale))
    with open_features(robot) as host:
        robot.start()
        events, flight = host.tap().events, host.parts["recorder"].flight
        wait = partial(wait_until, timeout_s=60.0, clock=MonotonicClock())
        assert wait(lambda: "device" in {event.subject for event in events.since(0)[0]})
        robot.fault_injector.trip(2, 0x8611)
        assert wait(lambda: flight.saved or flight.failed)
        robot.shutdown()
    assert (flight.saved, passed) == (1, [passes])
