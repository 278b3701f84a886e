"""Robots as packages: installed as a third party would, found by name, and extended."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.command_line import Robotd

from robotd.cli.exit_codes import ExitCode
from robotd.descriptor import load_robot_descriptor
from robotd.errors import DescriptorError

URDFS = Path(__file__).parents[2] / "urdf"
OFFLINE = ("--no-index", "--no-deps", "--no-build-isolation", "--quiet")


def run(folder: Path, *command: str) -> str:
    """Output of a Python module, with the packages that are installed in ``folder``."""
    path = os.pathsep.join((str(folder), os.environ.get("PYTHONPATH", "")))
    done = subprocess.run(
        [sys.executable, "-m", *command],
        capture_output=True, text=True, timeout=55, check=False, cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def overlay(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text(f"schema: 1\nname: cell\n{text}", encoding="utf-8")
    return path


@pytest.mark.timeout(180)
def test_an_installed_package_is_found_by_name_and_passes_its_test(
    robotd: Robotd, tmp_path: Path
) -> None:
    urdf = str(URDFS / "scara.urdf")
    arguments = ("--urdf", urdf, "--package", "--into", str(tmp_path))
    assert robotd("new-robot", "press", *arguments).exit_code == 0
    package, site = tmp_path / "robotd-press", tmp_path / "site"
    run(tmp_path, "pip", "install", *OFFLINE, "--target", str(site), str(package))
    assert f"{site}/robotd_press/robots/press/robot.yaml" in run(site, "robotd", "robots")
    assert "all checks passed" in run(site, "robotd", "check", "--robot", "press")
    tests = ("-p", "no:cacheprovider", str(package / "tests"))
    assert "2 passed" in run(site, "pytest", "-q", *tests)


def test_a_robot_extends_an_installed_one_by_name(robotd: Robotd, tmp_path: Path) -> None:
    result = robotd("new-robot", "cell7", "--extends", "baymax", "--into", str(tmp_path))
    assert result.exit_code == 0, result.output
    path = tmp_path / "cell7" / "robot.yaml"
    path.write_text(path.read_text("utf-8") + "cycle: {rate_hz: 250}\n", encoding="utf-8")
    robot, base = load_robot_descriptor(path), load_robot_descriptor("baymax")
    assert (robot.name, robot.cycle.rate_hz) == ("cell7", 250.0)
    assert robot.drive == base.drive
    assert robot.urdf == base.urdf  # beside the file that names it


def test_an_unknown_base_is_named_with_file_and_line(tmp_path: Path) -> None:
    with pytest.raises(DescriptorError, match=r"robot\.yaml:3: extends: .*did you mean 'cr3a'"):
        load_robot_descriptor(overlay(tmp_path, "extends: cr3b\n"))


def test_a_problem_in_the_base_names_both_files(tmp_path: Path) -> None:
    base = tmp_path / "base.yaml"
    base.write_text("schema: 1\nname: base\naxes: 0\n", encoding="utf-8")
    path = overlay(tmp_path, "extends: ./base.yaml\n")
    with pytest.raises(DescriptorError) as error:
        load_robot_descriptor(path)
    assert f"{base}:3: axes: must be at least 1" in str(error.value)
    assert str(error.value).endswith(f"; extended by {path}")


def test_an_unknown_robot_is_not_extended(robotd: Robotd, tmp_path: Path) -> None:
    result = robotd("new-robot", "cell7", "--extends", "cr4", "--into", str(tmp_path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "unknown robot 'cr4'" in result.stderr
    assert not (tmp_path / "cell7").exists()
