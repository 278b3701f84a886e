"""``robotd program`` against a robot in another process, its action and its topic."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from robotd_msgs.action import RunProgram
from robotd_msgs.msg import ProgramState
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_for, wait_until
from tests.ros.test_client_commands import positions, robotd, started

from robotd.cli.exit_codes import ExitCode

pytestmark = pytest.mark.ros

READY = "{joint1: 0.4, joint2: 0.3, joint3: 1.4, joint4: -0.2, joint5: 1.2, joint6: 0.0}"
BACK = "{joint1: 0, joint2: 0, joint3: 0, joint4: 0, joint5: 0, joint6: 0}"
POSES = f"poses:\n  ready: {READY}\n  back: {BACK}\n"


@pytest.fixture(scope="module")
def arm() -> Iterator[RobotProcess]:
    with RobotProcess(robot="cr3a", simulated_time=True, backend="sim") as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        yield client


@pytest.fixture
def states(client: Client) -> list[Any]:
    return client.listen(ProgramState, "/robotd/program", LATCHED)


def file_of(tmp_path: Path, steps: str, speed: float = 1.0) -> str:
    path = tmp_path / "cell.yaml"
    path.write_text(f"speed: {speed}\n{POSES}steps:\n{steps}", encoding="utf-8")
    return str(path)


def state(states: list[Any]) -> ProgramState:
    return states[-1] if states else ProgramState()


def test_a_program_is_checked_run_and_shown(
    arm: RobotProcess, tmp_path: Path, states: list[Any]
) -> None:
    steps = "  - move: {pose: ready}\n  - line: {by: {z: 0.05}}\n  - gripper: close\n"
    file = file_of(tmp_path, f"{steps}  - message: all done\n")
    code, output, _ = robotd(arm.domain, "program", "check", file)
    assert (code, output) == (0, f"{file}: 4 steps can be executed from where the arm is\n")
    assert positions(arm.domain)[0] == pytest.approx(0.0, abs=1e-6)
    code, output, error = robotd(arm.domain, "program", "run", file)
    assert (code, output) == (0, f"{file}: 4 steps were executed\n")
    assert "step 1 of 4: move: {pose: ready}" in error
    assert positions(arm.domain)[0] == pytest.approx(0.4, abs=2e-3)
    output = robotd(arm.domain, "program", "status")[1]
    assert output.startswith(f"{file}: done\n")
    assert "all done" in output
    assert json.loads(robotd(arm.domain, "program", "status", "--json")[1])["executed"] == 4
    wait_until(lambda: state(states).state == "done", "the topic shows the end")
    assert (
        robotd(arm.domain, "program", "run", file_of(tmp_path, "  - move: {pose: back}\n"))[0] == 0
    )


def test_what_cannot_be_names_line_and_key(arm: RobotProcess, tmp_path: Path) -> None:
    file = file_of(tmp_path, "  - move: {pose: ready}\n  - line: {by: {z: 0.6}}\n")
    before = positions(arm.domain)
    for command in ("check", "run", "step"):
        code, _, error = robotd(arm.domain, "program", command, file)
        assert code == 1
        assert f"{file}:7: steps.1.line: at " in error
        assert "joint3" in error
    assert positions(arm.domain) == pytest.approx(before, abs=1e-6)
    code, _, error = robotd(arm.domain, "program", "check", file_of(tmp_path, "  - mve: {}\n"))
    assert (code, "unknown key; did you mean 'move'?" in error) == (1, True)
    for command in ("stop", "pause"):
        code, _, error = robotd(arm.domain, "program", command)
        assert (code, "no program runs" in error) == (1, True)


def test_it_is_stopped_and_resumed_by_commands(
    arm: RobotProcess, tmp_path: Path, states: list[Any], client: Client
) -> None:
    steps = "  - message: {text: insert a part, wait: true}\n  - move: {pose: ready}\n"
    file = file_of(tmp_path, steps)
    action = GoalClient(client.node, RunProgram, "/robotd/run_program")
    wait_until(action.server_is_ready, "no action")
    feedback: list[Any] = []
    goal = RunProgram.Goal(file=file, text=Path(file).read_text(encoding="utf-8"))
    handle = wait_for(
        action.send_goal_async(goal, lambda message: feedback.append(message.feedback))
    )
    wait_until(lambda: state(states).state == "waiting", "it waits for the operator")
    assert state(states).message == "insert a part"
    refused = robotd(arm.domain, "program", "run", file)
    assert (refused[0], "a program runs already" in refused[2]) == (1, True)
    assert robotd(arm.domain, "program", "stop")[0] == 0
    answer = wait_for(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.message.endswith("stopped at step 1 of 2: by the operator")
    wait_until(lambda: feedback and feedback[-1].state == "waiting", "feedback shows it")
    assert (feedback[-1].step, feedback[-1].steps, feedback[-1].line) == (1, 2, 6)
    goal = RunProgram.Goal(mode=RunProgram.Goal.RESUME)
    handle = wait_for(action.send_goal_async(goal))
    wait_until(lambda: state(states).state == "waiting", "it waits again")
    output = robotd(arm.domain, "program", "resume")[1]
    assert output == f"{file} goes on\n"
    assert wait_for(handle.get_result_async()).status == GoalStatus.STATUS_SUCCEEDED
    assert positions(arm.domain)[0] == pytest.approx(0.4, abs=2e-3)
    code, _, error = robotd(arm.domain, "program", "resume")
    assert (code, "no program was stopped" in error) == (1, True)
    action.destroy()


def test_ctrl_c_stops_it_at_rest(arm: RobotProcess, tmp_path: Path, states: list[Any]) -> None:
    file = file_of(tmp_path, "  - repeat: {steps: [{move: {pose: back}}, {move: {pose: ready}}]}\n")
    with started(arm.domain, "program", "run", file) as process:
        wait_until(
            lambda: state(states).state == "running" and state(states).executed >= 2,
            "it repeats",
        )
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == ExitCode.INTERRUPTED
    assert "canceled by the client" in output
    wait_until(lambda: state(states).state == "stopped", "the topic shows it")
    before = positions(arm.domain)
    assert positions(arm.domain) == pytest.approx(before, abs=1e-6)
    code, output, _ = robotd(arm.domain, "program", "step", file)
    assert code == 0
    assert "one step was executed; the next is" in output
