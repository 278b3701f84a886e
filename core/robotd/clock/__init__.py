"""Monotonic clocks in nanoseconds, the only source of time below ROS.

ROS time appears in ``robotd_ros`` only. Everything else takes a ``Clock`` so that tests can
run without waiting.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

NANOSECONDS = 1_000_000_000


class Clock(Protocol):
    """Monotonic time. Any thread may call."""

    def now_ns(self) -> int:
        """Nanoseconds since an arbitrary start; never goes back."""
        ...

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Block until ``now_ns() >= deadline_ns``; returns at once when that is past."""
        ...


class MonotonicClock:
    """CLOCK_MONOTONIC of the operating system."""

    now_ns = staticmethod(time.monotonic_ns)

    def sleep_until_ns(self, deadline_ns: int) -> None:
        remaining_ns = deadline_ns - time.monotonic_ns()
        if remaining_ns > 0:
            time.sleep(remaining_ns / NANOSECONDS)


def wait_until(
    condition: Callable[[], bool], timeout_s: float, clock: Clock, poll_s: float = 0.002
) -> bool:
    """Poll ``condition`` every ``poll_s`` until it is true; False after ``timeout_s``.

    The condition is evaluated at least once, and once more after the time is over.
    """
    deadline_ns = clock.now_ns() + round(timeout_s * NANOSECONDS)
    while not condition():
        now_ns = clock.now_ns()
        if now_ns >= deadline_ns:
            return condition()
        clock.sleep_until_ns(min(deadline_ns, now_ns + round(poll_s * NANOSECONDS)))
    return True
