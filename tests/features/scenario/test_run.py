"""Programs of scenarios: what passes, what fails, and that a run can be repeated bit for bit."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from tests.features.scenario.harness import MOVE, robot, run

from robotd.descriptor import load_robot_descriptor
from robotd.descriptor.group_settings import GroupSettings
from robotd.errors import DescriptorError, InvalidArgument
from robotd.plugin.manager import load_backend
from robotd_scenario import Result, Scenario, ScenarioRun, load_scenario
from robotd_scenario.sim_command import run_scenario

EXAMPLES = Path(__file__).parents[3] / "examples"
NOISE = {"torque_noise_nm": 0.3, "velocity_noise_rad_s": 0.01}
TRAJECTORY = {
    "joints": ["joint2", "joint1"],
    "points": [
        {"at_s": 1.0, "positions_rad": [0.2, 0.6]},
        {"at_s": 2.0, "positions_rad": [0.5, 0.3]},
    ],
}


def test_a_program_that_goes_as_expected_passes() -> None:
    result = run(
        MOVE,
        {"check": {"joints_rad": {"joint1": 1.0, "joint2": 0.0}, "standstill": True}},
        {"trajectory": TRAJECTORY},
        {"gripper": "closed"},
        {"check": {"gripper": "closed", "within_s": 0.5, "servos_on": [0, 1], "alarms": []}},
        {"servos": "off"},
        {"check": {"servos_on": []}},
        {**MOVE, "expect": "rejected", "reason": "servo is off"},
        {"engine": "off"},
        {"check": {"engine": "Running"}},
    )
    assert result.failures == []
    assert 3.0 < result.simulated_s < 3.6


def test_a_step_moves_the_joint_group_that_its_joints_are_in() -> None:
    groups = {"left": GroupSettings(joints=("joint1",)), "right": GroupSettings(joints=("joint2",))}
    both = {"joint1": 0.0, "joint2": 0.0}
    result = run(
        MOVE,
        {"move": {"to_rad": {"joint2": 0.4}, "time_s": 1.0}},
        {"check": {"joints_rad": {"joint1": 1.0, "joint2": 0.4}}},
        {"move": {"to_rad": both, "time_s": 1.0}, "expect": "rejected", "reason": "of one group"},
        descriptor=robot().model_copy(update={"groups": groups}),
    )
    assert result.failures == []


@pytest.mark.parametrize(
    ("step", "failure"),
    [
        ({"check": {"joints_rad": {"joint1": 0.5}}},
         "joint1 is at 0.000000 rad, not within 0.001 of 0.5"),
        ({"check": {"joints_rad": {"nobody": 0.5}}}, "unknown joint 'nobody'"),
        ({"check": {"engine": "Idle", "alarms": [1], "standstill": False}},
         "engine is Communicating; alarms: none; all axes stand"),
        ({"check": {"gripper": "closed"}}, "gripper is 0% closed"),
        ({**MOVE, "expect": "fault"}, "expected fault, got ok: goal reached"),
        ({**MOVE, "reason": "nonsense"}, "does not contain 'nonsense'"),
        ({"move": {"to_rad": {"joint1": 9.0}, "time_s": 5.0}}, "expected ok, got rejected: "),
    ],
)  # fmt: skip
def test_what_is_not_as_expected_fails_and_ends_the_run(step: Any, failure: str) -> None:
    result = run(step, {"wait_s": 100.0})
    assert len(result.failures) == 1
    assert failure in result.failures[0]
    assert result.simulated_s < 10.0


def test_a_move_of_a_robot_without_joints_is_rejected() -> None:
    result = run(MOVE, descriptor=load_robot_descriptor("baymax"))
    assert "got rejected: unknown joint 'joint1' (available: none)" in result.failures[0]


def test_a_repeated_program_ends_with_its_first_failure() -> None:
    steps = [MOVE, {"check": {"joints_rad": {"joint1": 0.0}}}]
    result = run({"repeat": {"times": 3, "program": steps}}, {"wait_s": 100.0})
    assert len(result.failures) == 1
    assert result.simulated_s < 2.0


def test_repeating_does_it_as_often_as_asked() -> None:
    result = run({"repeat": {"times": 5, "program": [{"wait_s": 0.2}]}})
    assert result.simulated_s == pytest.approx(1.0)


def paced(scale: float, seed: int) -> Result:
    values = {
        "schema": 1,
        "options": {**NOISE, "seed": seed},
        "faults": [{"at_s": 0.3, "amp_alarm": {"axis": 0}}],
        "program": [{**MOVE, "expect": "fault"}, {"servos": "on"}, MOVE],
    }
    scenario = ScenarioRun(Scenario.model_validate(values), robot(), load_backend("sim"), scale)
    assert [done.failure for done in scenario.steps()] == [None] * 3
    return scenario.result


def test_the_same_seed_gives_the_same_joint_states_at_any_speed() -> None:
    slow, fast = paced(4.0, seed=1), paced(float("inf"), seed=1)
    assert (slow.digest, slow.periods) == (fast.digest, fast.periods)
    assert slow.real_s > 0.2
    assert paced(float("inf"), seed=2).digest != fast.digest


@pytest.mark.parametrize(
    "path", sorted(EXAMPLES.rglob("scenarios/*.yaml")), ids=lambda path: path.stem
)
def test_the_examples_pass(path: Path) -> None:
    from robotd.descriptor import load_robot_descriptor

    scenario = load_scenario(path)
    assert scenario.robot is not None
    descriptor = load_robot_descriptor(scenario.robot, scenario.variant)
    execution = ScenarioRun(scenario, descriptor, load_backend(scenario.backend))
    for _ in execution.steps():
        pass
    assert execution.result.failures == []


def test_mistakes_in_a_file_are_told_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(
        "schema: 1\n"
        "faults:\n"
        "  - amp_alarm: {axis: -1}\n"
        "  - {at_s: 1.0, engine_stopped: null}\n"
        "program:\n"
        "  - move: {to_rad: {joint1: 1.0}, tim_s: 1.0}\n"
        "  - {wait_s: 1.0, expect: fault}\n"
        "  - {wait_s: 1.0e+300}\n"
        "  - check: {within_s: 1.0}\n"
        "  - trajectory: {joints: [joint1], points: []}\n",
        encoding="utf-8",
    )
    with pytest.raises(DescriptorError) as caught:
        load_scenario(path)
    lines = str(caught.value).splitlines()
    for expected in (
        f"{path}:3: faults.0.amp_alarm.axis: must be greater than or equal to 0",
        f"{path}:4: faults.1: needs exactly one of amp_alarm",
        f"{path}:9: program.3.check: has no condition",
        f"{path}:10: program.4.trajectory.points: must have 1 or more items (value [])",
        f"{path}:6: program.0.move.tim_s: unknown key; did you mean 'time_s'?",
        f"{path}:6: program.0.move.time_s: missing",
        f"{path}:7: program.1: expect and reason do not go with wait_s",
        f"{path}:8: program.2.wait_s: must be at most 1e+06",
    ):
        assert any(line.startswith(expected.split(" must")[0]) for line in lines), expected
    assert "; without keys it is written engine_stopped: {}" in lines[1]


def test_a_wrong_option_is_named_with_the_file_of_the_scenario(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("schema: 1\nrobot: cr3a\noptions: {sed: 1}\nprogram: [{wait_s: 1}]\n")
    with pytest.raises(DescriptorError) as caught:
        run_scenario(path, None, None)
    assert str(caught.value) == f"{path}: backends.sim.sed: unknown key; did you mean 'seed'?"


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("amp_alarm: {axis: 9}", "faults.0: amp_alarm axis=9 code=8976: axis 9 is outside 0..5"),
        (
            "when: {joint: joint7, above_rad: 1}, amp_alarm: {axis: 1}",
            "unknown joint 'joint7'; did you mean",
        ),
    ],
)
def test_a_fault_that_does_not_fit_is_named(tmp_path: Path, fault: str, reason: str) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(f"schema: 1\nrobot: cr3a\nfaults:\n  - {{{fault}}}\nprogram: [{{wait_s: 1}}]\n")
    with pytest.raises(InvalidArgument, match=re.escape(reason)):
        run_scenario(path, None, None)


def test_a_scenario_without_a_program_does_not_pass(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("schema: 1\nrobot: cr3a\n")
    with pytest.raises(DescriptorError, match="has no program"):
        run_scenario(path, None, None)


def test_a_robot_file_is_found_beside_the_scenario(tmp_path: Path) -> None:
    path = tmp_path / "one.yaml"
    path.write_text("schema: 1\nrobot: my/robot.yaml\n", encoding="utf-8")
    assert load_scenario(path).robot == str(tmp_path / "my/robot.yaml")
