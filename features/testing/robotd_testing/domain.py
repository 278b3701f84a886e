"""Reservation of a ROS domain that no other test on this computer uses."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

FIRST, LAST = 1, 100  # 0 is the default of all; above 101 ports collide with ephemeral ones


@contextmanager
def own_domain() -> Iterator[int]:
    """Reserve a domain until the block ends; yield its number. Any process, any thread.

    Raises RuntimeError when all are taken.
    """
    begin = FIRST + os.getpid() % LAST
    for domain in chain(range(begin, LAST + 1), range(FIRST, begin)):
        path = Path(tempfile.gettempdir(), f"robotd-domain-{domain}.lock")
        try:
            descriptor = os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o666)
        except PermissionError:
            continue  # of another user
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            continue
        try:
            yield domain
        finally:
            os.close(descriptor)  # and with it the lock; the file stays for the next one
        return
    raise RuntimeError(f"ROS domains {FIRST} to {LAST} are all taken by other tests")
