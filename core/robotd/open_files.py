"""Limit of open files of a process that serves ports and records."""

from __future__ import annotations

import resource

from robotd.log import get_logger

log = get_logger("serve")

MAX_OPEN_FILES = 512  # of a process with every port full, its recorder and its bus included


def reserve_files() -> None:
    """Raise the limit of open files to what a recording needs in addition to full ports.

    Logs a warning where the system does not allow as many.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < MAX_OPEN_FILES:
        unlimited = hard == resource.RLIM_INFINITY
        allowed = MAX_OPEN_FILES if unlimited else min(MAX_OPEN_FILES, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, hard))
        if allowed < MAX_OPEN_FILES:
            log.warning(
                "few open files are allowed: clients of the ports could end a recording",
                limit=allowed,
                needed=MAX_OPEN_FILES,
                advice=f"ulimit -n {MAX_OPEN_FILES}",
            )
