"""``robotd export`` on the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from click.testing import Result

Robotd = Callable[..., Result]


def test_it_prints(robotd: Robotd) -> None:
    result = robotd("export", "moveit", "--robot", "cr3a", "--namespace", "left")
    assert result.exit_code == 0, result.output
    parameters = yaml.safe_load(result.stdout)["/**"]["ros__parameters"]
    controllers = parameters["moveit_simple_controller_manager"]["controller_names"]
    assert controllers == ["left/movensys_manipulator_arm_controller", "left/gripper_controller"]


def test_it_writes_a_file(robotd: Robotd, tmp_path: Path) -> None:
    file = tmp_path / "isaac.yaml"
    result = robotd("export", "isaac", "--robot", "cr3a", "--variant", "orin", "-o", str(file))
    assert (result.exit_code, result.stdout) == (0, "")
    assert "/isaacsim/joint_command" in file.read_text(encoding="utf-8")


def test_a_refusal_leaves_the_file_alone(robotd: Robotd, tmp_path: Path) -> None:
    file = tmp_path / "nav2.yaml"
    file.write_text("mine", encoding="utf-8")
    result = robotd("export", "nav2", "--robot", "cr3a", "-o", str(file))
    assert result.exit_code == 3
    assert "nav2: cr3a has no drive" in result.stderr
    assert file.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("namespace", ["1x", "a//b", "a b", "~/x"])
def test_what_is_no_namespace_is_rejected(robotd: Robotd, namespace: str) -> None:
    result = robotd("export", "moveit", "--robot", "cr3a", "--namespace", namespace)
    assert result.exit_code == 2
    assert "is not a ROS namespace" in result.stderr


def test_a_file_that_cannot_be_written_is_one_sentence(robotd: Robotd, tmp_path: Path) -> None:
    result = robotd("export", "urdf", "--robot", "cr3a", "-o", str(tmp_path / "no" / "x"))
    assert result.exit_code == 2
    assert "Could not open file" in result.stderr
