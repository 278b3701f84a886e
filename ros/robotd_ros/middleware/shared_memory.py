"""Removal of what killed processes left in shared memory.

Works around: Fast DDS makes a segment of half a megabyte for each process in /dev/shm, and beside
it a file that the owner keeps locked while it runs. The two of a process that was killed stay: a
robot that a supervisor kills and restarts would fill the memory.
Measured: the search takes 0.2 ms, once at start.
Upstream: https://github.com/eProsima/Fast-DDS/issues/2790 (answer: ``fastdds shm clean``).
Ends with: no version, it is by design.
Shown by: tests/ros/unit/test_shared_memory.py, tests/ros/test_middleware.py.
"""

from __future__ import annotations

import fcntl
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

FOLDER = Path("/dev/shm")  # noqa: S108 - where Fast DDS keeps them
YOUNG_S = 10.0  # a file that was just made may not be locked yet
_LOCK = re.compile(r"fastrtps_[0-9a-f]{16}_el")


def remove_leftovers(folder: Path = FOLDER) -> int:
    """Remove the segments whose owners are dead; return their number. Any thread.

    Files of other users, and those in use, stay.
    """
    removed = 0
    for lock in _orphans(folder):
        try:
            lock.with_name(lock.name.removesuffix("_el")).unlink(missing_ok=True)
            lock.unlink(missing_ok=True)
        except OSError:
            continue
        removed += 1
    return removed


def _orphans(folder: Path) -> Iterator[Path]:
    """Yield the lock files of this user that no process holds."""
    for path in folder.glob("fastrtps_*_el"):
        try:
            if _LOCK.fullmatch(path.name) and _is_orphan(path):
                yield path
        except OSError:
            continue  # gone in the meantime, or not ours


def _is_orphan(path: Path) -> bool:
    facts = path.lstat()
    if facts.st_uid != os.geteuid() or time.time() - facts.st_mtime < YOUNG_S:
        return False
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True
