"""Time limits of the checks: set-up, check and end of each fail when they hang."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

import pytest

from robotd_conformance.checks.inconclusive import UNDECIDED, load
from robotd_conformance.checks.interruption import INTERRUPTION
from robotd_shared.foreign_process import note_step

CHECK_LIMIT_S = 60.0
PATIENCE_S = 180.0  # with a check that waits for a processor
MIN_LEFT_S = 0.05


class TimeLimits:
    """A plugin of pytest; it also notes the running check for the parent process."""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        INTERRUPTION.between_checks()
        note_step(f"running {item.name}")
        with _limited(f"the set-up of {item.name}"):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        with _limited(item.name):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        with INTERRUPTION.during_shutdown(), _limited(f"the end of {item.name}"):
            return (yield)

    def pytest_unconfigure(self) -> None:
        note_step("done")


@contextmanager
def _limited(what: str) -> Iterator[None]:
    """Fail after ``CHECK_LIMIT_S``, by a signal; time in the queue of a processor is granted.

    After ``PATIENCE_S`` a check that has had less than its time is inconclusive.
    """
    began_s, queued_s = time.monotonic(), queue_times_s()

    def expire(number: int, frame: FrameType | None) -> None:
        passed_s, waited_s = time.monotonic() - began_s, longest_wait_s(queued_s)
        left_s = CHECK_LIMIT_S - (passed_s - waited_s)
        if left_s <= MIN_LEFT_S:
            pytest.fail(f"{what} did not end within {CHECK_LIMIT_S:g} s")
        if passed_s >= PATIENCE_S:
            pytest.skip(
                f"{UNDECIDED}, {load()}; seen: {what} did not end within {passed_s:.0f} s,"
                f" {waited_s:.0f} s of which it waited for a processor"
            )
        note_step(f"waiting for {what}")  # the parent process sees that it is not stuck
        signal.setitimer(signal.ITIMER_REAL, min(left_s, PATIENCE_S - passed_s) + MIN_LEFT_S)

    handler = signal.signal(signal.SIGALRM, expire)
    before = signal.setitimer(signal.ITIMER_REAL, CHECK_LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *before)
        signal.signal(signal.SIGALRM, handler)


def longest_wait_s(before_s: dict[str, float]) -> float:
    """Return how long a thread has waited for a processor since ``queue_times_s`` at most."""
    now_s = queue_times_s()
    waits_s = (time_s - before_s.get(thread, 0.0) for thread, time_s in now_s.items())
    return max(waits_s, default=0.0)


def queue_times_s() -> dict[str, float]:
    """Return the time that each thread has waited for a processor; empty: not counted here."""
    times_s = {}
    for path in Path("/proc/self/task").glob("*/schedstat"):
        with suppress(OSError, IndexError):  # a thread that has ended meanwhile
            times_s[path.parent.name] = int(path.read_text(encoding="ascii").split()[1]) * 1e-9
    return times_s
