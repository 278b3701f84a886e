"""``robotd path`` against a robot in another process: recorded, played, reversed and stopped."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from robotd_msgs.msg import SavedPaths
from robotd_msgs.srv import BeginPath, DeletePath, KeepPath, PlanPath, RenamePath
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_until
from tests.ros.test_client_commands import WAIT_S, positions, robotd

pytestmark = pytest.mark.ros

PATIENT = ("--timeout", "60")  # on a busy computer


@pytest.fixture(scope="module")
def arm_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("arm") / "robot.yaml"
    file.write_text("extends: cr3a\nname: arm\nposes: poses.yaml\n", encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def arm(arm_file: Path) -> Iterator[RobotProcess]:
    with RobotProcess(robot=str(arm_file), simulated_time=True, backend="sim") as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        yield client


@contextmanager
def started(domain: int, text: str, *words: str) -> Iterator[subprocess.Popen[str]]:
    """Run ``robotd path`` until it prints ``text``."""
    process = subprocess.Popen(
        [str(Path(sys.executable).with_name("robotd")), "path", *words],
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert process.stdout is not None
        said = ""
        while text not in said:
            line = process.stdout.readline()
            assert line, said
            said += line
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def wipe(arm: RobotProcess, client: Client) -> None:
    """A path from 0.4 to -0.4 rad of joint1, recorded while the arm is jogged."""
    assert robotd(arm.domain, "move", "joint1=0.4", "joint3=0.5")[0] == 0
    with started(arm.domain, "Ctrl-C ends it", "record", "wipe", *PATIENT) as process:
        code, _, error = robotd(arm.domain, "jog", "joint1", "-0.8", "--speed", "0.4")
        assert code == 0, error
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=WAIT_S)
    assert process.returncode == 0, output
    assert "wipe: " in output
    assert " points, at most 0.00" in output


def test_a_recorded_jog_is_played_reversed_and_stopped_in_the_middle(
    arm: RobotProcess, client: Client, wipe: None
) -> None:
    told = client.listen(SavedPaths, "/robotd/paths", LATCHED)
    wait_until(lambda: told and [path.name for path in told[-1].paths] == ["wipe"], "the path")
    assert (told[-1].paths[0].problem, told[-1].paths[0].joints[0]) == ("", "joint1")
    code, output, error = robotd(arm.domain, "path", "play", "wipe", "--reverse", *PATIENT)
    assert code == 0, error
    assert "goal reached after " in output
    assert positions(arm.domain)[0] == pytest.approx(0.4, abs=3e-3)
    code, _, error = robotd(arm.domain, "path", "play", "wipe", "--reverse", *PATIENT)
    assert code == 1  # it begins at the other end now
    assert "the path begins elsewhere: joint1 by -0." in error
    assert positions(arm.domain)[0] == pytest.approx(0.4, abs=3e-3)
    states = client.listen(JointState, "/joint_states")
    slow = ("play", "wipe", "--speed", "0.1", *PATIENT)
    with started(arm.domain, "off the path", *slow) as process:
        wait_until(lambda: states and states[-1].position[0] < 0.2, "the middle of the path")
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=WAIT_S)
    assert process.returncode == 130, output
    stopped = positions(arm.domain)
    assert -0.3 < stopped[0] < 0.2
    assert stopped[2] == pytest.approx(0.5, abs=3e-3)
    options = output.split("robotd path play wipe ")[1].split(" goes on")[0].split()
    code, output, error = robotd(arm.domain, "path", "play", "wipe", *options, *PATIENT)
    assert code == 0, error
    assert positions(arm.domain)[0] == pytest.approx(-0.4, abs=3e-3)
    assert robotd(arm.domain, "path", "play", "wipe", "--approach", *PATIENT)[0] == 0


def test_what_cannot_be_is_named(arm: RobotProcess, wipe: None) -> None:
    for words, reason in (
        (("play", "wip"), "unknown path 'wip'; did you mean 'wipe'?"),
        (("record", "wipe"), "there is a path 'wipe' already"),
        (("end",), "no path is being recorded"),
        (("rename", "wipe", "a b"), "'a b' is not a valid name of a path"),
        (("delete", "none"), "unknown path 'none'"),
    ):
        code, _, error = robotd(arm.domain, "path", *words)
        assert code == 1, words
        assert reason in error, words
    output = robotd(arm.domain, "path", "show", "wipe")[1]
    assert "first to its start: joint1 by +0." in output
    assert output.splitlines()[-6].split()[0] == "joint1"


def test_services_record_and_say_what_is_wrong(arm: RobotProcess, client: Client) -> None:
    def call(service_type: Any, service: str, **values: object) -> Any:
        return client.call(service_type, f"/robotd/paths/{service}", **values)

    assert not call(KeepPath, "keep").success
    assert call(BeginPath, "begin", name="raise").success
    other = call(BeginPath, "begin", name="other")
    assert (other.success, other.message.split(",")[0]) == (False, "raise is being recorded")
    state = call(KeepPath, "keep")
    assert (state.success, state.name, state.reason) == (True, "raise", "")
    assert len(state.joints) == len(state.positions) == 6
    assert robotd(arm.domain, "move", "joint2=0.1")[0] == 0
    assert call(Trigger, "end").message.startswith("raise: ")
    plan = call(
        PlanPath, "plan", name="raise", reverse=True, timing=PlanPath.Request.LIMITS, speed=0.5
    )
    assert plan.success, plan.message
    first, last = plan.trajectory.points[0], plan.trajectory.points[-1]
    second = plan.trajectory.joint_names.index("joint2")
    assert (first.time_from_start.sec, first.time_from_start.nanosec) == (0, 0)
    assert first.positions[second] == pytest.approx(0.1, abs=3e-3)
    assert last.positions[second] < 0.05
    assert [*last.velocities] == [0.0] * 6
    assert (len(plan.parts), plan.parts[-1]) == (len(plan.trajectory.points), 1.0)
    for values, reason in (
        ({"name": ""}, "unknown path ''"),
        ({"timing": 7}, "timing is 7, must be 0 (RECORDED) or 1 (LIMITS)"),
        ({"begin": 1.5}, "begin is 1.5, must be 0 to less than 1"),
        ({"speed": float("nan")}, "speed is nan, must be 0.01 to 1"),
    ):
        answer = call(PlanPath, "plan", **{"name": "raise", **values})
        assert not answer.success
        assert reason in answer.message
    assert call(RenamePath, "rename", name="raise", new_name="lift").success
    assert call(DeletePath, "delete", name="lift").message == "lift is deleted"


def test_a_recording_of_the_robot_becomes_a_path_that_it_plays(
    arm: RobotProcess, arm_file: Path, client: Client, wipe: None
) -> None:
    told = client.listen(SavedPaths, "/robotd/paths", LATCHED)
    assert robotd(arm.domain, "move", "joint1=0.3", "joint3=0.5")[0] == 0
    code, output, error = robotd(arm.domain, "snapshot")
    assert code == 0, error
    words = ("--name", "again", "--robot", str(arm_file))
    code, output, error = robotd(arm.domain, "path", "import", output.strip(), *words)
    assert code == 0, error
    assert output.startswith("again: ")
    # It was written beside the robot, which publishes it by itself.
    wait_until(lambda: told and "again" in [path.name for path in told[-1].paths], "the path")
    code, output, error = robotd(arm.domain, "path", "play", "again", "--approach", *PATIENT)
    assert code == 0, (output, error)
    assert positions(arm.domain)[0] == pytest.approx(0.3, abs=0.01)
