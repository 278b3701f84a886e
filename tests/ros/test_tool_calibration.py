"""``robotd tool calibrate`` with an arm that touches: into the robot's file, with its comments."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.ros.robot_process import WAIT_S, RobotProcess
from tests.ros.test_client_commands import robotd

from robotd.api import FloatArray, load_robot_descriptor
from robotd_tool_space import Kinematics, pose_of

pytestmark = pytest.mark.ros

ROBOT = """# An arm of ours.
extends: cr3a
name: arm  # by its owner
tool_space:
  velocity_m_s: 0.2  # slow
"""
TIP = pose_of((0.01, -0.02, 0.12))
START = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
KINEMATICS = Kinematics.of_descriptor(load_robot_descriptor("cr3a"), "joints").with_tool(TIP)
FIRST = KINEMATICS.forward(START)
POINT = FIRST[:3, 3]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "robot.yaml"
    path.write_text(ROBOT, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def arm(file: Path) -> Iterator[RobotProcess]:
    tool = "tool_space.tools={pen: {xyz_m: [0.01, -0.02, 0.12]}}"
    arguments = ("--set", tool)
    with RobotProcess(*arguments, robot=str(file), simulated_time=True, backend="sim") as process:
        process.wait_ready()
        yield process


@contextmanager
def calibrating(arm: RobotProcess, *words: str) -> Iterator[subprocess.Popen[str]]:
    environment = {"ROS_DOMAIN_ID": str(arm.domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with subprocess.Popen(
        [sys.executable, "-m", "robotd", "tool", "calibrate", *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | environment | {"PYTHONUNBUFFERED": "1"},
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def touch(arm: RobotProcess, process: subprocess.Popen[str], joints: FloatArray) -> None:
    """Go there when the command asks for it, and press Enter."""
    assert process.stdout is not None
    assert process.stdin is not None
    for line in process.stdout:
        if "press Enter" in line:
            break
    words = [f"joint{number + 1}={angle:.9f}" for number, angle in enumerate(joints)]
    code, output, error = robotd(arm.domain, "move", *words, "--time", "4")
    assert code == 0, output + error
    process.stdin.write("\n")
    process.stdin.flush()


def posture(turn: Rotation, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> FloatArray:
    """Joint positions that turn the tool about its tip, from ``START``, and move it."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.as_matrix() @ FIRST[:3, :3], POINT + offset
    return KINEMATICS.inverse(pose, START)


def test_a_tip_is_found_and_is_in_the_file(arm: RobotProcess, file: Path) -> None:
    turns = [[0, 0, 0], [35, 0, 0], [0, 35, 0], [-25, -25, 40]]
    with calibrating(arm, "found", "--file", str(file)) as process:
        for turn in turns:
            touch(arm, process, posture(Rotation.from_euler("xyz", turn, degrees=True)))
        output, _ = process.communicate(timeout=WAIT_S)
    assert process.returncode == 0, output
    assert "mm of one point" in output
    text = file.read_text(encoding="utf-8")
    assert "# An arm of ours.\n" in text
    assert "velocity_m_s: 0.2  # slow\n" in text
    found = load_robot_descriptor(file)
    node = text.partition("found: {xyz_m: [")[2].partition("]")[0]
    assert [float(number) for number in node.split(",")] == pytest.approx(TIP[:3, 3], abs=2e-3)
    assert found.name == "arm"


def test_a_frame_is_found_with_the_tool_that_is_chosen(arm: RobotProcess) -> None:
    assert robotd(arm.domain, "tool", "set", "pen")[0] == 0
    with calibrating(arm, "table", "--frame") as process:
        for offset in ([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.02, 0.08, 0.0]):
            touch(arm, process, posture(Rotation.identity(), offset))
        output, _ = process.communicate(timeout=WAIT_S)
    assert process.returncode == 0, output
    assert output.startswith("tool_space:\n  work_frames:\n    table: {xyz_m: [")
    numbers = output.partition("[")[2].partition("]")[0]
    assert [float(number) for number in numbers.split(",")] == pytest.approx(POINT, abs=2e-3)
    assert "rpy_rad: [" in output


def test_touches_in_one_pose_are_refused(arm: RobotProcess, file: Path) -> None:
    before = file.read_text(encoding="utf-8")
    with calibrating(arm, "none", "--file", str(file)) as process:
        output, _ = process.communicate("\n\n\n\n", timeout=WAIT_S)
    assert process.returncode == 1, output
    assert "the poses are too alike: turn the tool by 30° and more" in output
    assert file.read_text(encoding="utf-8") == before
