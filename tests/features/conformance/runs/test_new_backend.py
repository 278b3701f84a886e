"""A generated backend: installed by pip into a new environment, checked and served.

The environment is new and sees what the one of this test has installed, robotd among it: what is
tested is the installation of the generated package, not that of ROS.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from control_msgs.action import FollowJointTrajectory
from sensor_msgs.msg import JointState
from tests.ros.robot_process import Client, RobotProcess
from trajectory_msgs.msg import JointTrajectoryPoint

NAME = "acme_bus"


def run(*command: str | Path, cwd: Path) -> str:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env=environment | {"PYTHONPATH": "", "PIP_DISABLE_PIP_VERSION_CHECK": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=360,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def new_environment(folder: Path) -> Path:
    """Make an environment that sees what this one has installed; return its interpreter."""
    run(sys.executable, "-m", "venv", "--without-pip", folder / "venv", cwd=folder)
    python = folder / "venv" / "bin" / "python"
    site = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder)
    here = sysconfig.get_path("purelib")
    line = f"import site; site.addsitedir({here!r})\n"
    (Path(site.strip()) / "outer.pth").write_text(line, encoding="utf-8")
    return python


def install(python: Path, package: Path) -> None:
    """Install ``package`` without an index of packages."""
    offline = ("--no-index", "--no-deps", "--no-build-isolation", "--quiet")
    run(python, "-m", "pip", "install", *offline, package, cwd=package)


def serve_and_move(process: RobotProcess) -> None:
    """Let a robot of six joints reach 0.3 rad over DDS, and end."""
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = [f"joint{number}" for number in range(1, 7)]
    point = JointTrajectoryPoint(positions=[0.3] * 6)
    point.time_from_start.sec = 1
    goal.trajectory.points = [point]
    process.wait_ready()
    client = Client(process.domain)
    try:
        states = client.listen(JointState, "/joint_states")
        result = client.send_goal(goal).result()[1]
        assert result.error_code == FollowJointTrajectory.Result.SUCCESSFUL, result.error_string
        # The goal has a tolerance, within which a busy computer may still be on its way.
        there = pytest.approx([0.3] * 6, abs=1e-3)
        client.next(states, lambda state: list(state.position[:6]) == there)
    finally:
        client.close()
    assert process.end() == 0, process.output


@pytest.fixture
def python(tmp_path: Path) -> Path:
    """A new environment."""
    return new_environment(tmp_path)


@pytest.fixture
def installed(python: Path, tmp_path: Path) -> Path:
    """The same with the generated package."""
    run(python, "-m", "robotd", "new-backend", NAME, cwd=tmp_path)
    install(python, tmp_path / "robotd-acme-bus")
    return python


@pytest.mark.timeout(400)
def test_a_generated_package_passes_at_once(installed: Path, tmp_path: Path) -> None:
    python = installed
    robotd = (python, "-m", "robotd")
    assert f"'{NAME}' (robotd_acme_bus of robotd-acme-bus 0.1.0)" in run(
        *robotd, "backends", "--check", NAME, cwd=tmp_path
    )
    checked = run(*robotd, "check", "--robot", "standalone", "--backend", NAME, cwd=tmp_path)
    assert "all checks passed" in checked
    junit = tmp_path / "results.xml"
    report = run(*robotd, "conform", "--backend", NAME, "--junit", junit, cwd=tmp_path)
    assert "verdict: passed" in report
    tested = int(re.findall(r"tested on (\d+)%", report)[-1])
    assert tested >= 80  # of all checks; it declares no scale, objects, registers or files
    assert junit.read_text(encoding="utf-8").count("<testcase") > 90


@pytest.mark.timeout(400)
def test_a_minimal_package_is_small_and_passes_at_once(python: Path, tmp_path: Path) -> None:
    run(python, "-m", "robotd", "new-backend", NAME, "--minimal", cwd=tmp_path)
    package = tmp_path / "robotd-acme-bus"
    files = [path for path in package.rglob("*") if path.is_file()]
    assert len(files) <= 3
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files) <= 150
    install(python, package)
    robotd = (python, "-m", "robotd")
    found = run(*robotd, "backends", "--check", NAME, cwd=tmp_path)
    assert "axes, simulated, velocity_mode" in found
    assert "not declared" not in found
    run(*robotd, "check", "--robot", "standalone", "--backend", NAME, cwd=tmp_path)
    report = run(*robotd, "conform", "--backend", NAME, "--quick", cwd=tmp_path)
    assert "verdict: passed" in report


@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")  # of an old lark in ROS
def test_a_generated_package_is_served(installed: Path) -> None:
    with RobotProcess(backend=NAME, python=installed) as process:
        serve_and_move(process)


@pytest.mark.parametrize("options", [(), ("--minimal",)], ids=["full", "minimal"])
def test_the_generated_code_is_in_order(
    options: tuple[str, ...], python: Path, tmp_path: Path
) -> None:
    """By the same rules as robotd's own, run in the package's folder as its author does."""
    run(python, "-m", "robotd", "new-backend", NAME, *options, cwd=tmp_path)
    package = tmp_path / "robotd-acme-bus"
    code = "robotd_acme_bus.py" if options else "robotd_acme_bus"
    settings = Path(__file__).parents[4] / "pyproject.toml"
    ruff = Path(sys.executable).parent / "ruff"
    run(ruff, "check", f"--config={settings}", code, cwd=package)
    run(ruff, "format", "--check", f"--config={settings}", code, cwd=package)


def test_the_kit_runs_by_pytest_alone(tmp_path: Path) -> None:
    arguments = (
        "--pyargs",
        "robotd_conformance.checks",
        "--robotd-backend",
        "sim",
        "-k",
        "enable",
    )
    report = run(sys.executable, "-m", "pytest", *arguments, cwd=tmp_path)
    assert "conformance of the sim backend on plain" in report
