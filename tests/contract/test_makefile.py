"""The Makefile installs by uv with ROS from wheels, by pip with an installed ROS.

``make --dry-run`` prints the recipes without running them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
INTERFACE = "interfaces/wmx_ros2_message/msg/AxisState.msg"

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="no make here")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """The files that the Makefile looks at, without .venv."""
    for name in ("Makefile", "pyproject.toml", INTERFACE):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, path)
    return tmp_path


def recipes(checkout: Path, command: str, **environment: str) -> str:
    """Return the commands that `make COMMAND` would run in a shell with these variables."""
    result = subprocess.run(
        ["make", "--dry-run", "--directory", checkout, command],
        check=False,
        capture_output=True,
        text=True,
        env={"PATH": os.environ["PATH"]} | environment,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def make_up_to_date(checkout: Path) -> None:
    """Pretend that .venv is made, later than every source."""
    for name in ("base-wheels", "robotd", "tools"):
        stamp = checkout / ".venv" / ".made" / name
        stamp.parent.mkdir(parents=True, exist_ok=True)
        stamp.touch()
        os.utime(stamp, (2e9, 2e9))


def installed_ros(folder: Path) -> dict[str, str]:
    """Return the variables of a shell that has sourced a ROS with rclpy in `folder`."""
    package = folder / "share" / "rclpy" / "package.xml"
    package.parent.mkdir(parents=True)
    package.touch()
    return {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": str(folder)}


def test_ros_from_wheels_is_installed_by_uv(checkout: Path) -> None:
    text = recipes(checkout, "run")
    assert "tools.install $compiled --editable '.[ros,page]'" in text
    assert "compiled='./interfaces'" in text
    assert "--system-site-packages" not in text


def test_an_installed_ros_keeps_pip(checkout: Path, tmp_path: Path) -> None:
    text = recipes(checkout, "run", **installed_ros(tmp_path / "ros"))
    assert "-m pip --quiet --disable-pip-version-check install $compiled" in text
    assert "--editable '.[page]'" in text
    assert "compiled=''" in text
    assert "--system-site-packages" in text
    assert "tools.install" not in text


def test_nothing_is_installed_twice(checkout: Path) -> None:
    make_up_to_date(checkout)
    assert "--editable" not in recipes(checkout, "run")


@pytest.mark.parametrize(
    ("name", "compiled"), [(INTERFACE, "./interfaces"), ("pyproject.toml", "")]
)
def test_interfaces_are_compiled_when_they_change(name: str, compiled: str, checkout: Path) -> None:
    make_up_to_date(checkout)
    os.utime(checkout / name, (3e9, 3e9))
    assert f"compiled='{compiled}'" in recipes(checkout, "run")
