"""A ROS from wheels and a sourced one never meet in a process."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from robotd.cli import preflight, ros_variables
from robotd.cli.exit_codes import RosUnavailable

VARIABLES = (
    *("ROS_DISTRO", "AMENT_PREFIX_PATH", "LD_LIBRARY_PATH", "PYTHONPATH"),
    *("ROS_DOMAIN_ID", "RMW_IMPLEMENTATION"),
)


@pytest.fixture(autouse=True)
def wheels_and_a_clean_shell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preflight, "HAS_ROS_WHEELS", True)
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """Make a folder that looks like a ROS installation."""
    package = tmp_path / "share" / "rclpy" / "package.xml"
    package.parent.mkdir(parents=True)
    package.touch()
    return tmp_path


@pytest.mark.parametrize(
    ("name", "value", "found"),
    [
        ("ROS_DISTRO", "jazzy", "ROS_DISTRO is 'jazzy'"),
        ("LD_LIBRARY_PATH", "/usr/lib:/opt/ros/jazzy/lib", "leads to /opt/ros/jazzy/lib"),
        ("PYTHONPATH", "/opt/ros/jazzy/lib/python3", "leads to /opt/ros/jazzy/lib/python3"),
        ("AMENT_PREFIX_PATH", "/nowhere:{prefix}", "AMENT_PREFIX_PATH leads to {prefix}"),
    ],
)
def test_a_sourced_ros_beside_wheels_is_rejected_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch, prefix: Path, name: str, value: str, found: str
) -> None:
    monkeypatch.setenv(name, value.format(prefix=prefix))
    with pytest.raises(RosUnavailable, match=re.escape(found.format(prefix=prefix))) as rejection:
        preflight.import_ros("robotd_ros.serve")
    assert "\n" not in str(rejection.value)
    assert "shell in which no ROS is sourced" in str(rejection.value)


def test_an_overlay_without_rclpy_is_no_second_ros(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    monkeypatch.setenv("LD_LIBRARY_PATH", "/usr/local/lib")
    assert preflight.sourced_ros() is None


def test_the_prefix_of_the_wheels_is_no_second_ros(
    monkeypatch: pytest.MonkeyPatch, prefix: Path
) -> None:
    monkeypatch.setattr(sys, "prefix", str(prefix))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
    assert preflight.sourced_ros() is None


def test_a_sourced_ros_alone_is_the_one_to_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preflight, "HAS_ROS_WHEELS", False)
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    assert (
        preflight.import_ros("robotd_ros.middleware.message_fields").__name__
        == "robotd_ros.middleware.message_fields"
    )


@pytest.mark.parametrize(
    ("missing", "remedy"),
    [
        ("control_msgs", "sudo apt install ros-jazzy-control-msgs"),
        ("robotd_msgs", "with colcon and source them: robotd docs how-to/install"),
    ],
)
def test_what_a_sourced_ros_lacks_is_named_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, missing: str, remedy: str
) -> None:
    monkeypatch.setattr(preflight, "HAS_ROS_WHEELS", False)
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    monkeypatch.setitem(sys.modules, missing, None)  # importing it raises ModuleNotFoundError
    with pytest.raises(RosUnavailable, match=re.escape(remedy)):
        preflight.import_ros(missing)


@pytest.mark.parametrize("domain", ["500", "233", "-1", "x", "0x10", "1.5"])
def test_a_wrong_domain_is_rejected_before_ros_is_asked(
    monkeypatch: pytest.MonkeyPatch, domain: str
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    with pytest.raises(RosUnavailable) as rejection:
        preflight.import_ros("robotd_ros.serve")
    assert str(rejection.value) == (
        f"ROS_DOMAIN_ID is {domain!r}, must be a whole number from 0 to 232"
    )


@pytest.fixture
def installed(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make an installed ROS with two middlewares the one in use."""
    index = prefix / ros_variables._INDEX
    index.mkdir(parents=True)
    for name in ("rmw_fastrtps_cpp", "rmw_cyclonedds_cpp", "rmw_implementation"):
        (index / name).touch()
    monkeypatch.setattr(sys, "prefix", "/nowhere")
    monkeypatch.setattr(preflight, "HAS_ROS_WHEELS", False)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{prefix}")


@pytest.mark.usefixtures("installed")
def test_a_middleware_that_is_not_installed_is_rejected_with_those_that_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")
    with pytest.raises(RosUnavailable) as rejection:
        preflight.import_ros("robotd_ros.serve")
    assert "'rmw_zenoh_cpp', which is not installed here" in str(rejection.value)
    assert "(installed: rmw_cyclonedds_cpp, rmw_fastrtps_cpp)" in str(rejection.value)


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("middleware", ["rmw_cyclonedds_cpp", ""])
def test_an_installed_middleware_is_not_rejected(
    monkeypatch: pytest.MonkeyPatch, middleware: str
) -> None:
    monkeypatch.setenv("RMW_IMPLEMENTATION", middleware)
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    preflight.import_ros("robotd.errors")
