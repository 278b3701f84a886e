"""Log files of ROS, which a computer with a read-only home cannot keep.

Works around: rcl refuses to start where its folder of logs cannot be made. robotd has a log of its
own, and no use for these files.
Measured: nothing; once at start.
Upstream: https://github.com/ros2/rcl_logging, none known.
Ends with: no version yet.
Shown by: tests/ros/unit/test_log_files.py.
"""

from __future__ import annotations

import os
from pathlib import Path

from robotd.folders import why_unwritable

WITHOUT = ("--ros-args", "--disable-external-lib-logs", "--")


def log_file_arguments() -> tuple[tuple[str, ...], str]:
    """Return arguments that leave out the log files, and why; empty: they are kept.

    The folder is that of rcl_logging_interface: ``ROS_LOG_DIR``, or ``log`` in ``ROS_HOME``, which
    is ``~/.ros`` by default.
    """
    home = Path(os.environ.get("ROS_HOME") or "~/.ros")
    folder = Path(os.environ.get("ROS_LOG_DIR") or home / "log")
    try:
        reason = why_unwritable(folder.expanduser())
    except RuntimeError as error:  # no home
        reason = str(error)
    return (WITHOUT, reason) if reason else ((), "")
