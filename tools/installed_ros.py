"""``python -m tools.installed_ros``: robotd beside an installed ROS, from its sources to a robot.

The installed ROS is a stand-in: a prefix like ``/opt/ros/jazzy``, made of the ROS wheels, with the
variables of its ``setup.bash``, and colcon. It does not model ``ros2``, ``launch`` and the Python
of a distribution; control_msgs, tf2_msgs and moveit_msgs are the subsets of this repository. In it
the workspace with the interfaces is built by colcon and robotd installed by pip, as
``docs/how-to/install.md`` and ``docs/how-to/launch.md`` say; then a robot is served.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tools.wheels import Environment, clean_variables, serve

from robotd_testing.domain import own_domain

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
    return [name for name in found if not name.startswith(("robotd", "scikit-build"))]


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


def sourced(variables: Mapping[str, str], file: Path) -> dict[str, str]:
    """Return the variables of a shell that had ``variables`` and has sourced ``file``."""
    script = f'. "{file}" && exec env -0'
    found = subprocess.run(
        ["bash", "-c", script], env=variables, capture_output=True, text=True, check=True
    )
    return dict(variable.split("=", 1) for variable in found.stdout.split("\0") if variable)


def main() -> None:
    """Build everything in a temporary folder, and serve a robot."""
    with (
        tempfile.TemporaryDirectory(prefix="robotd-installed-ros-") as name,
        own_domain() as domain,
    ):
        folder, prefix = Path(name), Path(name, "robotd")
        make_prefix(folder / "ros")
        print("the ROS prefix is made", flush=True)
        variables = sourced(
            clean_variables() | {"ROS_DOMAIN_ID": str(domain)}, folder / "ros" / "setup.bash"
        )
        interfaces = shutil.copytree(ROOT / "interfaces", folder / "ws" / "src" / "interfaces")
        for mark in interfaces.glob("*_msgs/COLCON_IGNORE"):
            mark.unlink()
        built = Environment(folder / "ws", variables).run("colcon", "build")
        print(built.strip().splitlines()[-1], flush=True)
        variables = sourced(variables, folder / "ws" / "install" / "setup.bash")
        ros = Environment(folder, variables)
        ros.run("python3", "-m", "venv", "--system-site-packages", prefix)
        pip = (prefix / "bin" / "pip", "--quiet", "--disable-pip-version-check", "install")
        ros.run(*pip, "--ignore-installed", f"{ROOT}[page]")
        variables["AMENT_PREFIX_PATH"] = f"{prefix}:{variables['AMENT_PREFIX_PATH']}"
        variables["PATH"] = f"{executables(folder, variables)}:{variables['PATH']}"
        print(serve(Environment(folder, variables)))


def executables(folder: Path, variables: Mapping[str, str]) -> Path:
    """Return the folder of the package's executables, as ``ros2 run`` finds it."""
    code = "from ament_index_python.packages import get_package_prefix as p; print(p('robotd'))"
    found = Environment(folder, variables).run("python3", "-c", code)
    return Path(found.strip(), "lib", "robotd")


if __name__ == "__main__":
    main()
