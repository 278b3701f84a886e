"""Checks of the computer before a robot starts: ROS 2 and real-time priority."""

from __future__ import annotations

import os
import sys
import threading
import time
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from robotd.cli.exit_codes import RosUnavailable
from robotd.cli.layout import warn
from robotd.cli.ros_variables import domain_problem, middleware_problem
from robotd.realtime import request_realtime

ROS_DISTRO = "jazzy"
INTERFACES = ("robotd_msgs", "wmx_ros2_message", "wmx_r2_message")  # built by the user
HAS_ROS_WHEELS = find_spec("ros_wheels_bootstrapper") is not None  # it comes with every ROS wheel


def import_ros(name: str) -> ModuleType:
    """Import the module ``name``, and with it rclpy.

    Raises RosUnavailable, with what to do about it, when a part of ROS is missing or broken, when
    there are two of them, or when a variable that ROS reads is wrong.
    """
    distro = os.environ.get("ROS_DISTRO")
    if HAS_ROS_WHEELS and (source := sourced_ros()):
        raise RosUnavailable(
            f"two ROS would be mixed: {source}, but this Python has its own ROS from wheels; use a"
            " shell in which no ROS is sourced, or make .venv anew in this one (make clean venv)"
        )
    if distro and distro != ROS_DISTRO:
        warn(f"ROS_DISTRO is {distro!r}, robotd is made for {ROS_DISTRO!r}: types may not match")
    if problem := domain_problem() or middleware_problem():
        raise RosUnavailable(problem)
    try:
        return import_module(name)
    except ImportError as error:
        missing = (error.name or "").partition(".")[0]
        if missing.startswith("robotd") and missing not in INTERFACES:
            raise  # our own mistake, not the installation's
        raise RosUnavailable(f"ROS 2 cannot be imported ({error}): {_remedy(missing)}") from error


def _remedy(missing: str) -> str:
    """Return what brings the package ``missing``; empty: a part of ROS that cannot be loaded."""
    if not sourced_ros():
        return (
            "install it with pip install 'robotd[ros]', or source an installed one:"
            f" . /opt/ros/{ROS_DISTRO}/setup.bash"
        )
    if missing in INTERFACES:
        return "build robotd's interfaces with colcon and source them: robotd docs how-to/install"
    if missing:
        return f"sudo apt install ros-{ROS_DISTRO}-{missing.replace('_', '-')}"
    return "the sourced ROS is incomplete, or made for another Python"


def sourced_ros() -> str | None:
    """Return the sign of a sourced ROS in this shell; None without one."""
    if distro := os.environ.get("ROS_DISTRO"):
        return f"ROS_DISTRO is {distro!r}"
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if not prefix or Path(prefix) == Path(sys.prefix):
            continue  # the wheels' own prefix is not a second ROS
        if Path(prefix, "share/rclpy/package.xml").is_file():
            return f"AMENT_PREFIX_PATH leads to {prefix}"
    for name in ("LD_LIBRARY_PATH", "PYTHONPATH"):
        for folder in os.environ.get(name, "").split(os.pathsep):
            if folder.startswith("/opt/ros/"):
                return f"{name} leads to {folder}"
    return None


def realtime_permitted(priority: int) -> bool:
    """Return True when a thread of this process may get the SCHED_FIFO ``priority`` (1..99).

    Tried on a thread that ends at once, so nothing of the process changes.
    """
    permitted = False

    def attempt() -> None:
        nonlocal permitted
        permitted = request_realtime(priority)

    thread = threading.Thread(target=attempt)
    thread.start()
    thread.join()
    return permitted


def process_age_s() -> float:
    """Return seconds since the kernel started this process, interpreter start-up included."""
    stat = Path("/proc/self/stat").read_text(encoding="ascii")
    start_ticks = int(stat.rpartition(")")[2].split()[19])
    return time.clock_gettime(time.CLOCK_BOOTTIME) - start_ticks / os.sysconf("SC_CLK_TCK")
