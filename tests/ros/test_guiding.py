"""``robotd guide`` against a robot in another process: held by Ctrl-C, its lease, and a stop."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.ros.robot_process import RobotProcess
from tests.ros.test_client_commands import positions, robotd

pytestmark = pytest.mark.ros

WAIT_S = 120.0  # on a busy computer
PATIENT = ("--lease", "60", "--timeout", "60")


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RobotProcess]:
    file = tmp_path_factory.mktemp("arm") / "robot.yaml"
    file.write_text("extends: cr3a\nname: arm\nposes: poses.yaml\n", encoding="utf-8")
    with RobotProcess(robot=str(file), simulated_time=True, backend="sim") as process:
        process.wait_ready()
        yield process


@contextmanager
def guide(domain: int, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Run ``robotd guide`` until it says that the joints can be moved by hand."""
    words = [str(Path(sys.executable).with_name("robotd")), "guide", *options]
    process = subprocess.Popen(
        words,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert process.stdout is not None
        said = ""
        while "can be moved by hand" not in said:
            line = process.stdout.readline()
            assert line, said
            said += line
        yield process
    finally:
        process.kill()
        process.communicate()


def inject(domain: int, axis: int, delta: float) -> None:
    fault = ("moved_by_hand", f"axis={axis}", f"delta_rad={delta}")
    code, _, error = robotd(domain, "sim", "inject", *fault)
    assert code == 0, error


def test_an_arm_is_led_by_hand_until_ctrl_c_and_held(arm: RobotProcess) -> None:
    with guide(arm.domain, *PATIENT) as process:
        inject(arm.domain, 0, 0.1)
        inject(arm.domain, 0, 0.1)
        code, _, error = robotd(arm.domain, "move", "joint1=0")
        assert code == 1
        assert "joint1: in use by hand guiding" in error
        assert robotd(arm.domain, "pose", "save", "led", "--replace")[0] == 0
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=WAIT_S)
    assert process.returncode == 0, output
    assert "hand guiding has ended: by the operator; the joints are held" in output
    assert positions(arm.domain)[0] == pytest.approx(0.2, abs=2e-3)
    assert robotd(arm.domain, "move", "joint1=0")[0] == 0


def test_too_fast_a_hand_ends_it_with_the_reason(arm: RobotProcess) -> None:
    with guide(arm.domain, *PATIENT) as process:
        inject(arm.domain, 1, 0.5)
        output, _ = process.communicate(timeout=WAIT_S)
    assert process.returncode == 1
    assert "joint2 was moved at" in output
    assert "the limit is 1.5 rad/s" in output
    assert robotd(arm.domain, "move", "joint2=0")[0] == 0


def test_a_client_that_is_killed_ends_it(arm: RobotProcess) -> None:
    with guide(arm.domain) as process:
        process.kill()
        arm.wait_output("its client has been silent for 1 s")
    assert robotd(arm.domain, "move", "joint1=0.1")[0] == 0


def test_a_stop_ends_it(arm: RobotProcess) -> None:
    with guide(arm.domain, *PATIENT) as process:
        assert robotd(arm.domain, "stop")[0] == 0
        output, _ = process.communicate(timeout=WAIT_S)
    assert process.returncode == 1
    assert "hand guiding has ended: motion is stopped" in output
    assert robotd(arm.domain, "reset")[0] == 0
