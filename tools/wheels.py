"""``python -m tools.wheels dist``: build the interfaces for each Python, and try the wheels.

The Pythons are those that ``interpreters`` finds; ``--newest`` takes the newest alone. The wheels
are tried as a user installs them, in an environment of its own without a compiler: first robotd
alone, then a robot with ROS.
"""

from __future__ import annotations

import argparse
import itertools
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from robotd_testing.domain import own_domain

MINORS = range(11, 14)  # CPython 3.11 to 3.13: those that the ROS wheels are for
# The interfaces need less of the C and C++ libraries than the ROS wheels themselves.
PLATFORM = f"manylinux_2_28_{platform.machine()}"
RUN_S = 1800.0  # the longest of a program
READY_S = 25.0  # from the command to the robot that is ready
ALONE = """
from robotd import open_robot
from robotd.motion import TrajectoryRequest

with open_robot("cr3a", "sim") as robot:
    request = TrajectoryRequest.from_rows(robot.joint_names, [1.0], [[0.2, 0, 0, 0, 0, 0]])
    with robot.follower.follow(request) as execution:
        execution.wait(5.0)
    assert abs(robot.image.copy().position[0] - 0.2) < 0.01
"""


def interpreters() -> list[str]:
    """Return a Python of each supported version that is here: on the path, or made by pyenv."""
    return [found for minor in MINORS if (found := find_interpreter(minor))]


def find_interpreter(minor: int) -> str | None:
    """Return the first that runs; a name on the path can be one that pyenv has switched off."""
    made = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"), "versions")
    names = [f"python3.{minor}", *map(str, made.glob(f"3.{minor}.*/bin/python"))]
    for name in (sys.executable, *names):
        check = f"import sys, ensurepip; sys.exit(sys.version_info[:2] != (3, {minor}))"
        if (
            shutil.which(name)
            and not subprocess.run([name, "-c", check], capture_output=True, check=False).returncode
        ):
            return name
    return None


def clean_variables() -> dict[str, str]:
    """Return the variables of this process without any Python environment or ROS."""
    left_out = ("AMENT_", "LD_LIBRARY_PATH", "PYTHON", "ROS_", "_ROS_", "VIRTUAL_ENV")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(left_out)}
    return kept | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


class Environment:
    """Programs that are found by ``PATH`` of ``variables``, and run in ``folder``."""

    def __init__(self, folder: Path, variables: Mapping[str, str]) -> None:
        self._folder, self._variables = folder, variables

    def begin(self, *words: str | Path) -> subprocess.Popen[str]:
        """Start a program of the environment; its output and errors come together."""
        return subprocess.Popen(
            words,
            env=self._variables,
            cwd=self._folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def run(self, *words: str | Path, expected: int = 0) -> str:
        """Run a program and return what it printed. Raises AssertionError for another status."""
        process = self.begin(*words)
        output, _ = process.communicate(timeout=RUN_S)
        assert process.returncode == expected, f"{words}: {process.returncode}\n{output}"
        return output

    def install(self, *wheels: str | Path) -> str:
        """Install by pip; return what it took."""
        began_s = time.monotonic()
        self.run("pip", "--quiet", "--disable-pip-version-check", "install", *wheels)
        return f"installed after {time.monotonic() - began_s:.0f} s"


def build_interfaces(python: str, dist: Path) -> Path:
    """Compile the interfaces for ``python``; return the wheel in ``dist``."""
    with tempfile.TemporaryDirectory() as folder:
        pip = (python, "-m", "pip", "--quiet", "--disable-pip-version-check", "wheel")
        subprocess.run([*pip, "--no-deps", "--wheel-dir", folder, "./interfaces"], check=True)
        (built,) = Path(folder).iterdir()
        tags = ("-m", "wheel", "tags", "--platform-tag", PLATFORM, str(built))
        name = subprocess.run(
            [sys.executable, *tags], check=True, capture_output=True, text=True
        ).stdout.strip()
        return Path(shutil.move(Path(folder, name), dist))


def try_wheels(python: str, robotd: Path, interfaces: Path) -> Iterator[str]:
    """Install the wheels in a new environment of ``python``, use them, and say what was seen."""
    with tempfile.TemporaryDirectory(prefix="robotd-wheels-") as folder, own_domain() as domain:
        subprocess.run([python, "-m", "venv", f"{folder}/venv"], check=True)
        variables = {
            "PATH": f"{folder}/venv/bin:{os.environ['PATH']}",
            "PIP_NO_COMPILE": "1",  # what is imported is compiled then
            "CC": "false",  # nothing is compiled here
            "CXX": "false",
            "ROS_DOMAIN_ID": str(domain),
        }
        environment = Environment(Path(folder), clean_variables() | variables)
        yield environment.install(robotd)
        environment.run("python", "-c", ALONE)
        assert "Operate a running robot" in environment.run("robotd", "docs")
        refused = environment.run("robotd", "--robot", "cr3a", "--backend", "sim", expected=6)
        assert "pip install" in refused, refused
        yield f"without ROS: {refused.strip().splitlines()[-1]}"
        yield environment.install(f"{robotd}[ros,page]", interfaces)
        yield serve(environment)


def serve(environment: Environment) -> str:
    """Start a robot with its page, move it, and end it; return what was seen."""
    began_s = time.monotonic()
    robot = environment.begin("robotd", "run", "--robot", "cr3a", "--backend", "sim", "--page", "0")
    try:
        assert robot.stdout is not None
        lines: list[str] = []
        for line in robot.stdout:
            lines.append(line)
            if "ready after" in line:
                break
        ready_s = time.monotonic() - began_s
        assert robot.poll() is None, "".join(lines)
        assert ready_s < READY_S, f"ready after {ready_s:.1f} s, the limit is {READY_S:g} s"
        environment.run("robotd", "move", "joint1=0.2")
        assert "+0.2000" in environment.run("robotd", "status")
        (address,) = set(re.findall(r"http://127\.0\.0\.1:\d+", "".join(lines)))
        with urllib.request.urlopen(address, timeout=10.0) as page:
            assert b"<script" in page.read()
    finally:
        robot.send_signal(signal.SIGINT)
        rest, _ = robot.communicate(timeout=30.0)
    assert robot.returncode == 0, rest
    seen = f"ready after {ready_s:.1f} s, {address} is served"
    return f"{seen}, joint1 has moved, the robot has ended in order"


def build_and_try(python: str, robotd: Path) -> None:
    """Do all of it for one Python, and print it."""
    began_s = time.monotonic()
    interfaces = build_interfaces(python, robotd.parent)
    print(f"{interfaces.name} after {time.monotonic() - began_s:.0f} s", flush=True)
    for seen in try_wheels(python, robotd, interfaces):
        print(f"{interfaces.name.split('-')[2]}: {seen}", flush=True)


def main(arguments: Sequence[str]) -> None:
    """Build and try the wheels of a folder that has the one of robotd."""
    parser = argparse.ArgumentParser(prog="tools.wheels")
    parser.add_argument("dist", type=Path, help="folder with the wheel of robotd")
    parser.add_argument("--newest", action="store_true", help="try the newest Python alone")
    options = parser.parse_args(arguments)
    (robotd,) = options.dist.absolute().glob("robotd-*.whl")
    pythons = interpreters()[-1 if options.newest else 0 :]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(build_and_try, pythons, itertools.repeat(robotd)))


if __name__ == "__main__":
    main(sys.argv[1:])
