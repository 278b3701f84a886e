"""``robotd path`` against a robot in another process: recorded, played, reversed and stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_until
from tests.ros.test_client_commands import WAIT_S, positions, robotd

pytestmark = pytest.mark.ros

PATIENT = ("--timeout", "60")  # on a busy computer


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RobotProcess]:
    file = tmp_path_factory.mktemp("arm") / "robot.yaml"
    file.write_text("extends: cr3a\nname: arm\nposes: poses.yaml\n", encoding="utf-8")
    with RobotProcess(robot=str(file), simulated_time=True, backend="sim") as process:
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


@pytest.mark.daily
def test_a_recorded_jog_is_played_reversed_and_stopped_in_the_middle(
    arm: RobotProcess, client: Client, wipe: None
) -> None:
    told = client.listen(String, "/robotd/paths", LATCHED)
    wait_until(lambda: told and list(json.loads(told[-1].data)) == ["wipe"], "the path")
    assert json.loads(told[-1].data)["wipe"]["problem"] == ""
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
        (("rename", "wipe", "a b"), "'a b' is no name of a path"),
        (("delete", "none"), "unknown path 'none'"),
    ):
        code, _, error = robotd(arm.domain, "path", *words)
        assert code == 1, words
        assert reason in error, words
    output = robotd(arm.domain, "path", "show", "wipe")[1]
    assert "first to its start: joint1 by +0." in output
    assert output.splitlines()[-6].split()[0] == "joint1"


def test_services_record_and_say_what_is_wrong(arm: RobotProcess, client: Client) -> None:
    def call(service: str, **values: object) -> tuple[bool, str]:
        parameters = [
            Parameter(key.rstrip("_"), value=value).to_parameter_msg()
            for key, value in values.items()
        ]
        service = f"/robotd/paths/{service}"
        result = client.call(SetParametersAtomically, service, parameters=parameters).result
        return result.successful, result.reason

    assert call("begin", name="raise")[0]
    assert call("begin", name="other")[1].startswith("raise is being recorded")
    state = json.loads(client.call(Trigger, "/robotd/paths/keep").message)
    assert (state["name"], state["reason"]) == ("raise", "")
    assert robotd(arm.domain, "move", "joint2=0.1")[0] == 0
    assert client.call(Trigger, "/robotd/paths/end").message.startswith("raise: ")
    done, answer = call("plan", name="raise", reverse=True, timing="limits", speed=0.5)
    assert done, answer
    plan = json.loads(answer)
    assert plan["times_s"][0] == 0.0
    assert len(plan["positions"]) == len(plan["velocities"]) == len(plan["times_s"])
    for values, reason in (
        ({}, "name: wrong or missing"),
        ({"timing": "slow"}, "timing is 'slow', must be recorded or limits"),
        ({"from_": 1.5}, "from is 1.5, must be 0 to less than 1"),
        ({"sped": 1.0}, "sped: wrong or missing; expected"),
    ):
        name = {"name": "raise"} if values else {}
        done, answer = call("plan", **name, **values)
        assert not done
        assert reason in answer
    assert call("rename", name="raise", new="lift")[0]
    assert call("delete", name="lift") == (True, "lift is deleted")
