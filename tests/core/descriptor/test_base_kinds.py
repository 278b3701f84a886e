"""Kinds of mobile bases from plugins."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from robotd.clock.simulated import SteppedClock
from robotd.descriptor import base_kinds, load_robot_descriptor
from robotd.errors import DescriptorError, PluginError
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

Install = Callable[..., Path]

EXAMPLE = Path(__file__).parents[3] / "examples" / "omni_base"
DRIVE = (EXAMPLE / "robot.yaml").read_text(encoding="utf-8")
PROGRAM = """
import sys
from robotd.clock import wait_until
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
clock = SteppedClock()
robot = Robot(load_robot_descriptor(sys.argv[1]), load_backend("sim"), clock)
robot.start()
def has_moved():
    robot.base.command(0.0, 0.0, 0.2, timeout_s=0.5)
    return robot.base.pose[1] > 0.05
assert wait_until(has_moved, 600.0, clock)  # the wheels are claimed in a thread, in its own time
print(*robot.base.pose)
robot.shutdown()
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment in which the example's kind of base is installed."""
    site = tmp_path_factory.mktemp("site")
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    arguments = ("--no-deps", "--no-build-isolation", "--target", str(site), str(EXAMPLE))
    subprocess.run([*pip, *arguments], check=True)
    path = [str(site), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, path))}


def run(env: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *words]
    return subprocess.run(command, env=env, capture_output=True, text=True, check=False)


@pytest.mark.long
def test_a_third_party_kind_is_checked_by_its_own_model(
    installed: dict[str, str], tmp_path: Path
) -> None:
    good = run(installed, "-m", "robotd", "check", "--robot", str(EXAMPLE / "robot.yaml"))
    assert good.returncode == 0, good.stdout + good.stderr
    file = tmp_path / "robot.yaml"
    file.write_text(DRIVE.replace("wheel_distance_m: 0.2", "wheel_distance_m: 0"), encoding="utf-8")
    wrong = run(installed, "-m", "robotd", "check", "--robot", str(file))
    assert wrong.returncode == 3
    assert "drive.wheel_distance_m: must be greater than 0" in wrong.stdout
    file.write_text(DRIVE.replace("kind: omni", "kind: omny"), encoding="utf-8")
    unknown = run(installed, "-m", "robotd", "check", "--robot", str(file))
    assert "(available: differential, mecanum, omni, skid_steer, tricycle)" in unknown.stdout


@pytest.mark.long
def test_a_third_party_base_moves_sideways(installed: dict[str, str]) -> None:
    done = run(installed, "-c", PROGRAM, str(EXAMPLE / "robot.yaml"))
    assert done.returncode == 0, done.stderr
    x, y, heading = map(float, done.stdout.split())
    assert y > 0.05
    assert abs(x) < 1e-3
    assert abs(heading) < 1e-3


def test_an_uninstalled_kind_is_unknown() -> None:
    with pytest.raises(DescriptorError, match="unknown kind of base"):
        load_robot_descriptor(str(EXAMPLE / "robot.yaml"))


@pytest.mark.parametrize(
    ("name", "source", "says"),
    [
        (
            "omni",
            "import nothing_here",
            "'omni' .plugin_acme of acme 1.2. cannot be imported: ModuleNotFoundError",
        ),
        ("omni", "OmniDrive = 3", "must be a subclass of DriveSettings"),
    ],
)
def test_a_kind_that_cannot_be_used_is_named(
    name: str, source: str, says: str, install: Install
) -> None:
    install(name, source, group="robotd.bases")
    with pytest.raises(PluginError, match=says):
        base_kinds.base_kind(name)


def test_kinematics_that_fail_are_named(install: Install, tmp_path: Path) -> None:
    source = (EXAMPLE / "src" / "robotd_omni.py").read_text(encoding="utf-8")
    source = source.replace("robotd_omni:kinematics", "plugin_acme:kinematics")
    source = source.replace("return OmniWheels(", "return divmod(1, 0, ")
    site = install("omni", source, group="robotd.bases")
    entries = next(site.glob("*.dist-info")) / "entry_points.txt"
    entries.write_text("[robotd.bases]\nomni = plugin_acme:OmniDrive\n", encoding="utf-8")
    descriptor = load_robot_descriptor(str(EXAMPLE / "robot.yaml"))
    with pytest.raises(
        PluginError, match=r"'omni' of acme 1.2: plugin_acme:kinematics failed: TypeError"
    ):
        Robot(descriptor, load_backend("sim"), SteppedClock())
