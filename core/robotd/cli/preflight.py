"""What the computer offers before a robot starts: ROS 2, and real-time priority."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path
from types import ModuleType

from robotd.cli.exit_codes import RosUnavailable
from robotd.cli.layout import warn

ROS_DISTRO = "jazzy"


def import_ros_server() -> ModuleType:
    """``robotd.ros.serve``, the first import of rclpy.

    Raises RosUnavailable, with what to do about it, when a part of ROS is missing or broken.
    """
    distro = os.environ.get("ROS_DISTRO")
    if distro and distro != ROS_DISTRO:
        warn(f"ROS_DISTRO is {distro!r}, robotd is made for {ROS_DISTRO!r}: types may not match")
    try:
        from robotd.ros import serve
    except ImportError as error:
        if (error.name or "").partition(".")[0] == "robotd":
            raise  # our own mistake, not the installation's
        raise RosUnavailable(
            f"ROS 2 cannot be imported ({error}): install it with pip install 'robotd[ros]',"
            f" or source an installed one: . /opt/ros/{ROS_DISTRO}/setup.bash"
        ) from error
    return serve


def realtime_permitted(priority: int) -> bool:
    """Whether a thread of this process may have the SCHED_FIFO ``priority`` (1..99).

    Tried on a thread that ends at once, so nothing of the process changes.
    """
    permitted = False

    def attempt() -> None:
        nonlocal permitted
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            permitted = True
        except OSError:
            permitted = False

    thread = threading.Thread(target=attempt)
    thread.start()
    thread.join()
    return permitted


def process_age_s() -> float:
    """Seconds since the kernel started this process, the interpreter's own start included."""
    stat = Path("/proc/self/stat").read_text(encoding="ascii")
    start_ticks = int(stat.rpartition(")")[2].split()[19])
    return time.clock_gettime(time.CLOCK_BOOTTIME) - start_ticks / os.sysconf("SC_CLK_TCK")
