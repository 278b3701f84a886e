"""Files that the wheel installs for the tools of ROS: index, executables, launch files."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

from robotd.descriptor import load_robot_descriptor
from robotd_ros.plugin import BUILT_IN

ROOT = Path(__file__).parents[2]
AMENT = ROOT / "ros" / "ament"
SOURCES = (
    "LICENSE", "README.md", "core", "features", "plugins", "pyproject.toml", "robots", "ros",
)  # fmt: skip
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
INTERFACES = {path.parent.name for path in ROOT.glob("interfaces/*/package.xml")}


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder in which the wheel, built from a copy of the sources, is installed."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder)
    offline = ("--no-deps", "--no-index")
    build = ("wheel", "--no-build-isolation", *offline, "--wheel-dir", "dist", ".")
    subprocess.run([*PIP, *build], cwd=folder, check=True)
    (wheel,) = (folder / "dist").glob("*.whl")
    # Without --ignore-installed pip would remove the robotd of this environment.
    install = ("install", "--ignore-installed", *offline, "--prefix", "prefix", str(wheel))
    subprocess.run([*PIP, *install], cwd=folder, check=True)
    return folder / "prefix"


def test_the_package_is_in_the_index(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packages = pytest.importorskip("ament_index_python.packages", reason="not part of this ROS")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
    assert packages.get_package_prefix("robotd") == str(prefix)
    share = Path(packages.get_package_share_directory("robotd"))
    assert (share / "package.xml").is_file()
    for kind in ("config", "launch"):
        installed = {path.name for path in (share / kind).iterdir() if path.is_file()}
        assert installed == {path.name for path in (AMENT / kind).iterdir() if path.is_file()}


def test_every_node_is_an_executable(prefix: Path) -> None:
    executables = {path.name for path in (prefix / "lib" / "robotd").iterdir()}
    assert executables == {*BUILT_IN, "robotd"}
    for name in executables:
        assert os.access(prefix / "lib" / "robotd" / name, os.X_OK)


@pytest.mark.parametrize("name", BUILT_IN)
def test_an_executable_is_its_node_on_a_robot_that_has_it(name: str) -> None:
    text = (AMENT / "lib" / name).read_text(encoding="utf-8")
    command = re.search(r'bin/robotd" run --robot (\S+) --nodes (\S+) "\$@"$', text, re.MULTILINE)
    assert command
    assert command[2] == name
    assert name in load_robot_descriptor(command[1]).nodes


@pytest.mark.ros
def test_an_executable_serves_until_its_signal(prefix: Path) -> None:
    environment = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    command = [prefix / "lib" / "robotd" / "wmx_io_node", "--verbose"]
    command += ["--ros-args", "-r", "__ns:=/cell"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line.startswith("ready after"):
                process.send_signal(signal.SIGINT)
    assert process.returncode == 0
    assert "robotd 0.1.0: standalone on sim" in lines[0]
    assert any(line.split() == ["nodes", "/cell/wmx_io_node"] for line in lines)


def test_package_xml_agrees_with_the_project() -> None:
    package = etree.parse(AMENT / "package.xml").getroot()
    project = PROJECT["project"]
    for key in ("name", "version", "description", "license"):
        assert package.findtext(key) == project[key]
    wheels = {
        name.removeprefix("ros-jazzy-").replace("-", "_")
        for requirement in project["optional-dependencies"]["ros"]
        if (name := requirement.partition("==")[0]).startswith("ros-jazzy-")
    }
    depends = {element.text for element in package.iter("exec_depend")}
    assert depends == wheels - {"rmw_fastrtps_cpp"} | INTERFACES | {"launch", "launch_ros"}
