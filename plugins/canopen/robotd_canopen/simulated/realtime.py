"""Real-time priority of the calling thread, where the system grants it."""

from __future__ import annotations

import os


def request_realtime(priority: int) -> bool:
    """Ask for SCHED_FIFO at ``priority`` (1 to 99; 0 asks for nothing); whether it was granted."""
    if priority <= 0:
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return False
    return True
