"""Time limits of the checks: set-up, check and end of each fail when they hang."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import pytest

from robotd_conformance.checks.interruption import INTERRUPTION
from robotd_shared.foreign_process import note_step

CHECK_LIMIT_S = 60.0


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
    """Fail after ``CHECK_LIMIT_S``, by a signal."""

    def expire(number: int, frame: FrameType | None) -> None:
        pytest.fail(f"{what} did not end within {CHECK_LIMIT_S:g} s")

    handler = signal.signal(signal.SIGALRM, expire)
    before = signal.setitimer(signal.ITIMER_REAL, CHECK_LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *before)
        signal.signal(signal.SIGALRM, handler)
