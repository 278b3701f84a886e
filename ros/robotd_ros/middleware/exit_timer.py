"""End of the process by a native timer, whatever the middleware does meanwhile.

Works around: ``destroy_participant`` of Fast DDS spins for ever now and then, in a call for which
rclpy holds the interpreter: no Python code runs any more, no signal handler and no other thread,
and only SIGKILL ends the process. A POSIX timer whose notification is ``_exit`` of the C library
needs no interpreter, and keeps the exit status.
Measured: 2 of 600 orderly stops hung.
Upstream: https://github.com/eProsima/Fast-DDS/issues/6193 (hang on destruction; open).
Ends with: no version yet.
Shown by: tests/ros/test_exit_timer.py.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_SIGEV_THREAD = 2  # signal.h


class _Value(ctypes.Union):
    """``union sigval``."""

    _fields_ = (("number", ctypes.c_int), ("pointer", ctypes.c_void_p))


class _Event(ctypes.Structure):
    """``struct sigevent`` of Linux, with the members of SIGEV_THREAD."""

    _fields_ = (
        ("value", _Value),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("padding", ctypes.c_byte * 32),
    )


class _Time(ctypes.Structure):
    """``struct timespec``."""

    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _Setting(ctypes.Structure):
    """``struct itimerspec``."""

    _fields_ = (("interval", _Time), ("value", _Time))


def exit_after(seconds: int, status: int) -> bool:
    """End the process with ``status`` in ``seconds``, unless it has ended by itself. Any thread.

    Standard output and error are flushed now: nothing that is written later survives the timer.

    Returns:
        False where the C library has no such timer; then nothing limits the end of the process.
    """
    return _started(seconds, status) is not None


@contextmanager
def exit_where_it_hangs(seconds: int, status: int) -> Iterator[None]:
    """End the process as ``exit_after`` does, unless the block ends before."""
    timer = _started(seconds, status)
    try:
        yield
    finally:
        if timer is not None:
            ctypes.CDLL(None).timer_delete(timer)


def _started(seconds: int, status: int) -> ctypes.c_void_p | None:
    """Return a timer that runs; None where there is none."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "timer_create"):
        return None
    event = _Event(
        value=_Value(number=status),
        notify=_SIGEV_THREAD,
        function=ctypes.cast(libc._exit, ctypes.c_void_p),  # noqa: SLF001 - the C function
    )
    timer = ctypes.c_void_p()
    clock = ctypes.c_int(time.CLOCK_MONOTONIC)
    if libc.timer_create(clock, ctypes.byref(event), ctypes.byref(timer)):
        return None
    setting = _Setting(value=_Time(seconds=seconds))
    return None if libc.timer_settime(timer, 0, ctypes.byref(setting), None) else timer
