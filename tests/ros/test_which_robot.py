"""Identity of a robot in status, and in commands where several robots run."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator

import pytest
from tests.ros.robot_process import RobotProcess, wait_until

from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros
ACTIONS = [
    ("move", "joint1=0.02"),
    ("gripper", "close"),
    ("speed", "100"),
    ("resume",),
    ("recover",),
]


def robotd(domain: int, namespace: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "robotd", *arguments, "--ros-args", "-r", f"__ns:={namespace}"]
    variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return subprocess.run(
        command, env=os.environ | variables, capture_output=True, text=True, timeout=90, check=True
    )


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    with own_domain() as number:
        yield number


@pytest.fixture(scope="module")
def left(domain: int) -> Iterator[RobotProcess]:
    with RobotProcess("--namespace", "left", domain=domain) as process:
        process.wait_ready()
        yield process


def test_status_names_the_robot(domain: int, left: RobotProcess) -> None:
    told = json.loads(robotd(domain, "/left", "status", "--json").stdout)["robot"]
    assert (told["robot"], told["namespace"], told["backend"]) == ("cr3a", "/left", "sim")
    assert (told["simulated"], told["computer"]) == (True, os.uname().nodename)
    text = f"cr3a in /left, backend sim, on {os.uname().nodename}, SIMULATED"
    variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    by_option = subprocess.run(
        [sys.executable, "-m", "robotd", "status", "--namespace", "left"],
        env=os.environ | variables, capture_output=True, text=True, timeout=90, check=True,
    )  # fmt: skip
    assert text in by_option.stdout


def test_commands_name_the_robot_that_they_reach_where_two_run(
    domain: int, left: RobotProcess
) -> None:
    with RobotProcess("--ros-args", "-r", "__ns:=/right", domain=domain) as right:
        right.wait_ready()
        for arguments in ACTIONS:
            told = robotd(domain, "/left", *arguments).stderr
            assert "robot: cr3a in /left, backend sim" in told, arguments
            assert "/right" not in told


def test_a_command_to_two_robots_of_one_namespace_is_rejected_but_for_a_stop(
    domain: int, left: RobotProcess
) -> None:
    variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    own = ["--ros-args", "-r", "__ns:=/left"]

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "robotd", *words, *own],
            env=os.environ | variables, capture_output=True, text=True, check=False,
        )  # fmt: skip

    def states() -> dict[int, str]:
        return {robot["pid"]: robot["state"] for robot in json.loads(run("list", "--json").stdout)}

    with RobotProcess(*own, domain=domain) as twin:
        twin.wait_ready()
        both = left.process.pid, twin.process.pid

        def is_rejected() -> bool:
            """Return whether ``reset``, which has no effect here, is: by whichever answers."""
            return "2 robots share" in run("reset").stderr

        # Until both know each other, the one that does not may be the one that answers.
        wait_until(lambda: all(is_rejected() for _ in range(3)), "both know each other")
        for words in (
            ["pause"],
            ["speed", "50"],
            ["servo", "off"],
            ["recover"],
            ["record", "--time", "1"],
            ["tool", "set", "x"],
            ["status"],
            ["status", "--json"],
            ["tool"],
            ["ik", "x=0.3"],
        ):
            rejected = run(*words)
            assert rejected.returncode, rejected.stdout
            assert "2 robots share this namespace, none gets the command" in rejected.stderr
            assert "__ns:=/NAME; robotd stop stops all of them" in rejected.stderr
            for pid in both:
                name = f"cr3a in /left, backend sim, on {os.uname().nodename}, SIMULATED"
                assert f"{name}, process {pid}" in rejected.stderr
        assert states() == dict.fromkeys(both, "ready")
        assert "stopped, at rest" in run("stop").stdout
        wait_until(lambda: states() == dict.fromkeys(both, "stopped"), "both are stopped")
    wait_until(lambda: not run("reset").returncode, "the other one is gone")


def test_the_robots_of_the_domain_are_listed_and_named_where_one_is_missed(
    domain: int, left: RobotProcess
) -> None:
    robots = json.loads(robotd(domain, "/", "list", "--json").stdout)
    assert [(robot["robot"], robot["namespace"]) for robot in robots] == [("cr3a", "/left")]
    assert robots[0]["simulated"] is True
    assert "SIMULATED" in robotd(domain, "/", "list").stdout
    command = [sys.executable, "-m", "robotd", "stop", "--timeout", "2"]
    variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    missed = subprocess.run(
        command, env=os.environ | variables, capture_output=True, text=True, check=False
    )
    assert missed.returncode != 0
    assert "cr3a in /left, backend sim" in missed.stderr
    assert "--ros-args -r __ns:=/left" in missed.stderr


@pytest.mark.parametrize("words", [("move", "joint1=0.3"), ("jog", "joint1", "0.1")])
def test_no_arm_of_another_namespace_moves(
    domain: int, left: RobotProcess, words: tuple[str, ...]
) -> None:
    """A stop from the same terminal would not reach it."""
    variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    done = subprocess.run(
        [sys.executable, "-m", "robotd", *words, "--timeout", "2"],
        env=os.environ | variables, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 5, done.stdout
    assert "cr3a in /left, backend sim" in done.stderr
    assert "--ros-args -r __ns:=/left" in done.stderr


def test_numbers_in_another_unit_are_rejected_with_what_to_give(
    domain: int, left: RobotProcess
) -> None:
    def told(*words: str) -> str:
        command = [sys.executable, "-m", "robotd", *words, "--ros-args", "-r", "__ns:=/left"]
        variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        done = subprocess.run(
            command, env=os.environ | variables, capture_output=True, text=True, check=False
        )
        assert done.returncode != 0
        return done.stderr

    assert "0.3 is in percent: give 30 for 30 %" in told("speed", "0.3")
    assert "positions are rad: --deg takes degrees" in told("move", "joint1=30")
