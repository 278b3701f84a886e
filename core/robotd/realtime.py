"""Scheduling of threads, as far as the system grants it."""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}  # number of the system call
_control_loop = threading.local()  # ``active`` in a thread that runs control periods
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")  # struct sched_attr of linux/sched/types.h


@contextmanager
def control_loop_thread() -> Iterator[None]:
    """Mark the calling thread as a control loop's until the block ends."""
    before, _control_loop.active = is_control_loop(), True
    try:
        yield
    finally:
        _control_loop.active = before


def is_control_loop() -> bool:
    """Return True in a control-loop thread, which must start and await no thread."""
    return getattr(_control_loop, "active", False)


def request_realtime(priority: int) -> bool:
    """Request SCHED_FIFO for the calling thread; True if the system granted it.

    A refusal is not an error: without CAP_SYS_NICE or an rtprio limit the thread keeps its
    scheduling.

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

    A refusal is not an error: without CAP_SYS_NICE or a nice limit a thread cannot go below 0.

    Args:
        niceness: -20, the most processor time, to 19.
    """
    try:
        os.setpriority(os.PRIO_PROCESS, 0, niceness)  # on Linux of the thread, not the process
    except OSError:
        return False
    return True


def request_time_slice(slice_s: float) -> bool:
    """Request a time slice for the calling thread and threads it starts; True if granted.

    Needs no privilege. Of two threads that are due the scheduler takes the one whose slice ends
    first, so that a short slice means a short wait, not less of the processor (from Linux 6.12 on).
    A thread of another scheduling policy keeps it.

    Args:
        slice_s: 0.0001 to 0.1.
    """
    number = _SCHED_SETATTR.get(platform.machine())
    if number is None or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False
    niceness = os.getpriority(os.PRIO_PROCESS, 0)
    slice_ns = round(slice_s * 1e9)
    attributes = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, 0, niceness, 0, slice_ns, 0, 0)
    status: int = ctypes.CDLL(None).syscall(number, 0, attributes, 0)
    return status == 0
