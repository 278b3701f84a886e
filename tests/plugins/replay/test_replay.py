"""The replay backend, behind the same facades as a real robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.features.harness import Observed
from tests.features.recorder.frames import ramp, write

from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.device.axes import Jog, Move
from robotd.device.state import ConnectionState, Operation
from robotd.errors import DescriptorError, NotReady, OperationError, Unsupported
from robotd.feature_host import FeatureHost
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_recording.recording_reader import Recording, read_recording
from robotd_replay.device import READ_ONLY
from robotd_scenario import validate_fault
from robotd_scenario.feature import open_scenario


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Recording]:
    """A motion of cr3a that ends with an alarm of joint 3, and a gripper that closes."""
    arm = Observed(tmp_path_factory.mktemp("replay"))
    arm.robot.io.set_output_bit(0, 0, True)
    arm.step(0.1)
    for level in (True, False):  # two periods
        arm.robot.io.set_output_bit(0, 5, level)
        arm.robot.step(2)
    with arm.goal([0.3] * 6):
        arm.step(0.4)
        arm.robot.fault_injector.trip(2, 0x8611)
        arm.step(0.3)
    arm.step(0.6)
    arm.flight.close()
    (path,) = arm.files()
    yield read_recording(path)
    arm.close()


def replay(path: Path, *overrides: str) -> Robot:
    values = [parse_override(text) for text in (f"backends.replay.file={path}", *overrides)]
    descriptor = load_robot_descriptor("cr3a", overrides=values)
    return Robot(descriptor, load_backend("replay"), SteppedClock())


def test_every_value_is_shown_at_its_time(recording: Recording) -> None:
    robot = replay(recording.path)
    robot.start()
    recorded = recording.frames[np.flatnonzero(recording.frames["ready"])[0] :]
    shown, alarms = [], []
    for _ in range(500):
        robot.step(1)
        shown.append(robot.image.values.copy())
        alarms.append(robot.image.alarm_code[2])
    last = len(recorded) - len(shown)
    same = [
        first
        for first in range(last)
        if np.array_equal(recorded["values"][first : first + 500], shown, equal_nan=True)
    ]
    assert len(same) == 1
    np.testing.assert_array_equal(recorded["numbers"][same[0] : same[0] + 500, 0, 2], alarms)
    assert set(alarms) == {0, 0x8611}
    assert robot.image.fault(2) == "amplifier alarm 34321"
    robot.shutdown()


def test_inputs_and_outputs_stay_after_the_recording(recording: Recording) -> None:
    robot = replay(recording.path, "backends.replay.repeat=false")
    robot.start()
    assert robot.io.live is not None
    outputs, shown = robot.io.live[1], list[int]()
    for _ in range(round(recording.duration_s * 500) + 5):
        robot.step(1)
        shown.append(outputs[0])
    assert shown[0] == 0
    assert shown[-1] == shown[-20] == 1
    robot.shutdown()


def goal(robot: Robot) -> None:
    request = TrajectoryRequest.from_rows(robot.joint_names, [1.0], [[0.1] * 6])
    with robot.follower.follow(request):
        pass


COMMANDS: dict[str, Callable[[Robot], object]] = {
    "goal": goal,
    "stream": lambda robot: robot.stream().close(),
    "move": lambda robot: robot.axes.move([Move(0, 0.1, Profile(1.0, 1.0, 1.0))]),
    "jog": lambda robot: robot.axes.jog([Jog(0, Profile(1.0, 1.0, 1.0))]),
    "servo on": lambda robot: robot.axes.servo(0, True),
    "servo off": lambda robot: robot.axes.servo(0, False),
    "clear alarm": lambda robot: robot.axes.clear_alarm(2),
    "mode": lambda robot: robot.axes.set_command_mode(0, 1),
    "stop": Robot.stop,
    "recover": Robot.recover,
    "speed": lambda robot: robot.set_speed(0.5),
    "pause": Robot.pause,
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_each_command_is_rejected_because_the_axes_are_read_only(
    recording: Recording, command: Callable[[Robot], object]
) -> None:
    robot = replay(recording.path, "backends.replay.repeat=false")
    robot.start()
    robot.axes.stop_latch.engage("by a message")  # no effect
    seen = set()
    for _ in range(round(recording.duration_s * 10) + 5):
        robot.step(50)
        seen.add((int(robot.image.operation[0]), robot.connection.ready))
        with pytest.raises(OperationError) as error:
            command(robot)
        assert str(error.value) == READ_ONLY
    assert seen >= {(Operation.IDLE, True), (Operation.STREAM, True)}
    assert not robot.connection.ready  # the recording has ended
    robot.shutdown()


def test_outputs_cannot_be_set(recording: Recording) -> None:
    robot = replay(recording.path)
    robot.start()
    robot.step(20)
    with pytest.raises(Unsupported, match="outputs of a recording: not supported"):
        robot.io.set_output_bit(0, 1, True)
    robot.step(150)
    assert robot.io.output_bit(0, 0)  # as it was recorded
    robot.shutdown()


def test_inputs_and_outputs_that_were_not_recorded_are_not_0(recording: Recording) -> None:
    robot = replay(recording.path)
    robot.start()
    robot.step(20)
    recorded = max(len(data) for _, data in recording.inputs)
    assert robot.io.input_bytes(recorded - 1, 1) == b"\0"
    with pytest.raises(NotReady, match=rf"input byte {recorded} is not in the recording"):
        robot.io.input_bytes(recorded, 1)
    robot.shutdown()


def test_inputs_and_outputs_are_shown_in_each_period(recording: Recording) -> None:
    robot = replay(recording.path)
    robot.start()
    live = robot.io.live
    assert live is not None
    outputs = []
    for _ in range(round(recording.duration_s * 500)):
        robot.step(1)
        outputs.append(live[1][0])
    assert outputs.count(0x21) == 2
    assert outputs.count(0x01) > 100
    robot.shutdown()


def test_it_begins_again_at_the_end_or_becomes_stale(recording: Recording) -> None:
    seconds = recording.duration_s + 0.5
    robot = replay(recording.path)
    robot.start()
    alarms = []
    for _ in range(round(2 * seconds * 50)):
        robot.step(10)
        alarms.append(bool(robot.image.amp_alarm[2]))
    assert (True, False) in pairwise(alarms)  # of the next round
    assert robot.connection.ready
    robot.shutdown()
    once = replay(recording.path, "backends.replay.repeat=false")
    once.start()
    once.step(round(seconds * 500))
    assert not once.connection.ready
    assert "old" in once.connection.fault
    once.shutdown()
    assert once.connection.state is ConnectionState.SHUTDOWN


def test_a_file_that_does_not_fit_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "three.mcap"
    write(path, ramp())
    with pytest.raises(DescriptorError, match=r"three\.mcap has 3 axes \(arm\), not 6"):
        replay(path)
    with pytest.raises(DescriptorError, match=r"none\.mcap: No such file"):
        replay(tmp_path / "none.mcap")


def test_time_of_a_recording_can_be_stepped_and_has_no_faults(recording: Recording) -> None:
    robot = replay(recording.path)
    host = FeatureHost(robot, (), "/", print)
    with open_scenario(host) as faults:
        assert faults is not None
        assert "faults" not in host.offered
        with pytest.raises(Unsupported, match="faults on request: not supported by the replay"):
            faults.add(validate_fault({"late_cycles": {"late_s": 0.1}}))
