"""examples/dobot_tcp: installed as a third party does, examined, tested and served.

Its own tests run here without the whole kit, which takes three minutes in real time: of the kit
some checks for what is special about a whole-arm controller.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tests.features.conformance.runs.test_new_backend import (
    install,
    new_environment,
    run,
    serve_and_move,
)
from tests.ros.robot_process import RobotProcess

EXAMPLE = Path(__file__).parents[4] / "examples" / "dobot_tcp"
BACKEND = "dobot_tcp_fake"
CHECKS = (
    "test_an_alarm_of_the_controller_is_one_alarm or test_a_time_stamp_is_that_of_its_values"
    " or test_a_trajectory_at_the_limits_is_followed or test_an_axis_stops_when_setpoints_stay_away"
)
MAX_LINES = 500  # of the backend, without blank lines


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the folder, as of a third party."""
    copy = tmp_path_factory.mktemp("third_party") / "example"
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    return shutil.copytree(EXAMPLE, copy, ignore=ignored)


@pytest.fixture(scope="module")
def installed(example: Path) -> Path:
    """A new environment with the package."""
    python = new_environment(example.parent)
    install(python, example)
    return python


def test_the_backend_is_short() -> None:
    files = (EXAMPLE / "src" / "robotd_dobot_tcp").rglob("*.py")
    lines = [line for path in files for line in path.read_text(encoding="utf-8").splitlines()]
    assert len([line for line in lines if line.strip()]) <= MAX_LINES


def test_it_is_a_backend_and_a_robot_like_any_other(installed: Path, tmp_path: Path) -> None:
    robotd, robot = (installed, "-m", "robotd"), ("--robot", "dobot_cr3a")
    address = ("--set", "backends.dobot_tcp.address=192.168.5.1")
    checked = run(*robotd, "backends", "--check", "dobot_tcp", *robot, *address, cwd=tmp_path)
    assert "all checks passed" in checked
    checked = run(*robotd, "check", *robot, *address, cwd=tmp_path)
    assert "joint3: lower limit -2.86 rad exceeds the device's -2.70526 rad" in checked
    assert "all checks passed" in checked


def test_it_passes_what_the_kit_asks_of_a_whole_arm(installed: Path, tmp_path: Path) -> None:
    robot = ("--robot", "dobot_cr3a", "--set", "engine.stale_after_s=0.5")
    command = ("conform", "--backend", BACKEND, *robot, "-k", CHECKS)
    report = run(installed, "-m", "robotd", *command, cwd=tmp_path)
    assert "verdict: passed" in report
    # On a busy computer one whose times say nothing may remain: they are measured in real time.
    assert "4 passed" in report or ("3 passed, 1 skipped" in report and "1 inconclusive" in report)


def test_its_own_tests_pass(installed: Path, example: Path) -> None:
    tests = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "not conforms")
    assert " passed" in run(installed, *tests, cwd=example)


@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")  # of an old lark in ROS
def test_it_serves_cr3a(installed: Path) -> None:
    patient = ("--set", "trajectory.path_tolerance_rad=0.3")  # the stand-in may stall, too
    robot = RobotProcess(*patient, robot="dobot_cr3a", backend=BACKEND, python=installed)
    with robot as process:
        serve_and_move(process)
