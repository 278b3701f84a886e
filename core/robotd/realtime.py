"""Scheduling of threads, as far as the system grants it."""

from __future__ import annotations

import os


def request_realtime(priority: int) -> bool:
    """Request SCHED_FIFO for the calling thread; True if the system granted it.

    A refusal is no error: without CAP_SYS_NICE or an rtprio limit the thread keeps its scheduling.

    Args:
        priority: 1 to 99; 0 requests nothing.
    """
    if priority <= 0:
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return False
    return True


def request_niceness(niceness: int) -> bool:
    """Request a niceness for the calling thread and those that it starts; True if granted.

    A refusal is no error: without CAP_SYS_NICE or a nice limit a thread cannot go below 0.

    Args:
        niceness: -20, the most processor time, to 19.
    """
    try:
        os.setpriority(os.PRIO_PROCESS, 0, niceness)  # on Linux of the thread, not the process
    except OSError:
        return False
    return True
