"""Flight recorder and continuous recording of a robot process, by its services."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from std_srvs.srv import SetBool, Trigger
from tests.ros.robot_process import WAIT_S, Client, RobotProcess, connected, wait_until
from tests.ros.test_client_commands import started
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from wmx_ros2_message.srv import SetAxis

from robotd.cli.exit_codes import ExitCode
from robotd.events import EventKind
from robotd_recording.recording_reader import Recording, read_recording

SOME_BYTES = 100_000
pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recordings")


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[Client]:
    arguments = ("--record-dir", str(folder), "--set", "recorder.after_s=0.5", "--time-scale", "1")
    with RobotProcess(*arguments) as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


def snapshot(client: Client) -> Recording:
    response = client.call(Trigger, "/robotd/snapshot")
    assert response.success, response.message
    return read_recording(Path(response.message))


def test_a_snapshot_names_the_sender_of_each_request(client: Client) -> None:
    for on in (0, 1):
        assert client.call(SetAxis, "/wmx/axis/set_on", index=[1], data=[on]).success
    recording = snapshot(client)
    found = [event.text for event in recording.events if event.sender == "/client"]
    assert found[:2] == ["servo: joint2, off", "servo: joint2, on"]
    frames = recording.frames
    assert (np.diff(frames["start_ns"]) > 0).all()
    assert np.isfinite(frames["values"][-1][:4]).all()


def test_a_goal_carries_its_client_and_its_points(client: Client) -> None:
    point = JointTrajectoryPoint(positions=[0.1] * 6, time_from_start=Duration(nanosec=500_000_000))
    names = [f"joint{number}" for number in range(1, 7)]
    trajectory = JointTrajectory(joint_names=names, points=[point])
    goal = client.send_goal(FollowJointTrajectory.Goal(trajectory=trajectory))
    assert goal.result()[1].error_code == 0
    recording = snapshot(client)
    goals = [event for event in recording.events if event.kind is EventKind.GOAL]
    assert [goal.sender for goal in goals] == ["/client"]
    np.testing.assert_array_equal(recording.goals[0][1]["positions"], [[0.1] * 6])


@pytest.mark.daily
def test_a_recording_runs_from_start_to_stop(client: Client, folder: Path) -> None:
    assert client.call(SetBool, "/robotd/record", data=True).success
    again = client.call(SetBool, "/robotd/record", data=True)
    assert not again.success
    assert "already recording" in again.message
    wait_until(lambda: size_of(folder.glob("*-record.mcap")) > SOME_BYTES, "a recording")
    stopped = client.call(SetBool, "/robotd/record", data=False)
    assert stopped.success, stopped.message
    (path,) = folder.glob("*-record.mcap")
    assert str(path) in stopped.message
    assert len(read_recording(path).frames) > 50


def test_an_alarm_is_recorded_without_a_request(client: Client, folder: Path) -> None:
    answer = client.inject("amp_alarm", axis=2, code=0x8611)
    assert answer.success, answer.message
    (path,) = wait_until(lambda: [*folder.glob("*-fault.mcap")], "the recording of the fault")
    assert read_recording(path).info.cause.startswith("joint3: amplifier alarm")


@contextmanager
def being_recorded(folder: Path) -> Iterator[tuple[RobotProcess, subprocess.Popen[str]]]:
    """A robot, and ``robotd record`` that records it into ``folder``."""
    with RobotProcess("--record-dir", str(folder)) as process:
        process.wait_ready()
        with started(process.domain, "record") as record:
            wait_until(lambda: size_of(folder.iterdir()) > SOME_BYTES, "a recording")
            yield process, record


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGQUIT])
def test_a_signal_stops_the_recording(tmp_path: Path, number: int) -> None:
    with being_recorded(tmp_path) as (_, record):
        record.send_signal(number)
        output, error = record.communicate(timeout=WAIT_S)
        assert record.returncode == ExitCode.OK, error
        (path,) = tmp_path.glob("*-record.mcap")
        assert str(path) in output
        assert len(read_recording(path).frames) > 50


def test_record_ends_when_the_robot_has_gone(tmp_path: Path) -> None:
    with being_recorded(tmp_path) as (process, record):
        process.end(signal.SIGTERM)
        _, error = record.communicate(timeout=WAIT_S)
    assert record.returncode == ExitCode.DEVICE
    assert "the robot has gone: the recording ends with it" in error


def size_of(paths: Iterable[Path]) -> int:
    return sum(path.stat().st_size for path in paths)


def test_a_robot_that_is_killed_leaves_a_complete_recording(tmp_path: Path) -> None:
    with RobotProcess("--record", str(tmp_path)) as process:
        process.wait_ready()
        wait_until(lambda: size_of(tmp_path.iterdir()) > SOME_BYTES, "a recording")
        process.end(signal.SIGKILL)
        (path,) = tmp_path.iterdir()

        def complete() -> bool:
            return path.read_bytes().endswith(b"\x89MCAP0\r\n")

        wait_until(complete, "the end of the file")
    assert len(read_recording(path).frames) > 50
