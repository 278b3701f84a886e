"""``robotd sim run --from``: what was commanded, repeated on the simulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from tests.features.harness import Observed

from robotd.cli import main
from robotd.descriptor import load_robot_descriptor
from robotd.device.axes import Move
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.plugin.manager import load_backend
from robotd_recording.recording_reader import read_recording
from robotd_scenario.recording_comparison import POSITION, CommandRepeater


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Observed]:
    observed = Observed(tmp_path)
    yield observed
    observed.close()


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["sim", "run", *map(str, arguments)])


def test_goals_and_moves_lead_to_the_same_motion(arm: Observed) -> None:
    with arm.goal([0.3, -0.2, 0.1, 0.0, 0.4, -0.5]):
        arm.step(1.2)
    arm.robot.axes.move([Move(1, 0.1, Profile(0.5, 2.0, 2.0))])
    arm.step(1.5)
    result = run("--from", arm.flight.snapshot("test"))
    assert result.exit_code == 0, result.output
    assert "the simulation moved as recorded" in result.output
    assert " commands over" in result.output
    assert "joint6" in result.output


def test_missed_periods_of_the_recording_are_no_difference(arm: Observed) -> None:
    arm.step(0.5)
    with arm.goal([0.3] * 6):
        arm.step(1.3)
    recording = read_recording(arm.flight.snapshot("test"))
    frames = np.delete(recording.frames, slice(50, 150))  # 0.2 s before the goal
    found = CommandRepeater(
        replace(recording, frames=frames), arm.robot.descriptor, load_backend("sim")
    ).run()
    assert len(found.recorded) == len(found.simulated)
    position = [frames["values"][:, POSITION, 0] for frames in (found.recorded, found.simulated)]
    np.testing.assert_allclose(*position, atol=0.01)


def test_goals_of_joint_groups_are_repeated_beside_each_other(tmp_path: Path) -> None:
    arms = Observed(tmp_path, robot="dual_cr3a")
    goals = [
        group.follower.follow(TrajectoryRequest.from_rows(group.joint_names, [time_s], [[0.3] * 6]))
        for group, time_s in zip(arms.robot.groups.values(), (1.0, 1.5), strict=True)
    ]
    with goals[0]:
        arms.step(0.3)
        with goals[1]:
            arms.step(1.8)
    recording = arms.flight.snapshot("test")
    arms.close()
    result = run("--from", recording)
    assert result.exit_code == 0, result.output
    assert "the simulation moved as recorded" in result.output
    assert "right_joint6" in result.output


def test_inputs_that_guard_the_robot_are_repeated(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        "extends: cr3a\nname: guarded\ninputs: {automatic: 0.3}\n"
        "stop_input: {input_byte: 0, input_bit: 5}\n"
        "tool_space: {reduced_speed_input: automatic}\n"
        "backends: {sim: {initial_inputs: [40]}}\n",
        encoding="utf-8",
    )
    arm = Observed(tmp_path, robot=str(file))
    with arm.goal([1.5, 0.8, 0.4, 0.0, 0.4, -0.5]):
        arm.step(1.2)
    arm.robot.fault_injector.set_input_bit(0, 3, False)
    arm.step(0.1)
    with arm.goal([0.0, 0.8, 0.4, 0.0, 0.4, -0.5]):
        arm.step(0.6)
        arm.robot.fault_injector.set_input_bit(0, 5, False)
        arm.step(0.6)
    assert arm.robot.image.position[0] > 0.5, "slow, and stopped on its way"
    recording = read_recording(arm.flight.snapshot("test"))
    arm.close()
    file.write_text(file.read_text(encoding="utf-8").replace("[40]", "[]"), encoding="utf-8")
    found = CommandRepeater(recording, load_robot_descriptor(file), load_backend("sim")).run()
    assert found.rejections == ()
    position = [frames["values"][:, POSITION, 0] for frames in (found.recorded, found.simulated)]
    np.testing.assert_allclose(*position, atol=0.02)


def test_the_first_difference_is_named(arm: Observed) -> None:
    with arm.goal([0.3] * 6):
        arm.step(0.5)
        arm.robot.fault_injector.trip(2, 0x8611)
        arm.step(0.8)
    result = run("--from", arm.flight.snapshot("test"))
    assert result.exit_code == 1, result.output
    last = result.output.splitlines()[-1]
    assert last.startswith("differs from 0."), last
    assert "recorded +0.1" in last


def test_a_recording_that_ends_when_the_robot_is_ready_is_named(arm: Observed) -> None:
    recording = read_recording(arm.flight.snapshot("test"))
    last = replace(recording, frames=recording.frames[-1:])
    with pytest.raises(ValueError, match="never ready with its servos on"):
        CommandRepeater(last, arm.robot.descriptor, load_backend("sim"))


def test_a_scenario_or_a_recording_is_needed(tmp_path: Path) -> None:
    assert run().exit_code == 2


def test_a_recording_that_cannot_be_read_is_status_3(tmp_path: Path) -> None:
    missing = run("--from", tmp_path / "none.mcap")
    assert (missing.exit_code, "No such file" in missing.output) == (3, True)
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"junk")
    for command in (["sim", "run", "--from"], ["explain"], ["record", "--recover"]):
        result = CliRunner().invoke(main, [*command, str(broken)])
        assert (result.exit_code, str(broken) in result.output) == (3, True), result.output
