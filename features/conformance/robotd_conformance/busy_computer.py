"""Further attempts of tests in real time that failed while the computer stalled."""

from __future__ import annotations

import threading
import time
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Protocol, Self

import pytest
from _pytest.runner import runtestprotocol

ATTEMPTS = 3
STALL_S = 0.03  # a thread that wakes up so late, and others with it
CALM_S = 1.0  # without a stall, before a further attempt
PATIENCE_S = 60.0  # for the computer to be calm
PERIOD_S = 0.005
UNDECIDED = "inconclusive: the computer was too busy to judge"
"""A test that skips itself with this reason is repeated at once."""


class StallMonitor:
    """Longest stall of this process while the context is open.

    A thread sleeps and looks how late it wakes up. Processor time that other processes take is
    seen as well as time that a host takes from a virtual machine.

    Attributes:
        longest_s: how late the thread woke up at most.
    """

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="stall monitor", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _watch(self) -> None:
        before_s = time.monotonic()
        while not self._end.wait(PERIOD_S):
            now_s = time.monotonic()
            self.longest_s = max(self.longest_s, now_s - before_s - PERIOD_S)
            before_s = now_s


class Target(Protocol):
    """Target of tests.

    Attributes:
        real_time: the test, or the attempt that has ended, ran in real time.
    """

    real_time: bool

    def begin(self, item: pytest.Item) -> None:
        """Prepare an attempt of a test."""

    def clear(self, item: pytest.Item) -> None:
        """Remove what a failed attempt has left behind."""


class BusyComputer:
    """A plugin of pytest that repeats a failed or undecided test, up to ``ATTEMPTS`` times.

    A failed one only in real time, and only when the computer stalled meanwhile: then control
    loops and simulated drives came late, too. What is at fault itself fails every attempt.

    Attributes:
        repeated: names of the tests that were repeated.
    """

    def __init__(self, target: Target) -> None:
        self._target = target
        self.repeated: list[str] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool:
        """Run the test, and report its last attempt."""
        reports: list[pytest.TestReport] = []
        where = {"nodeid": item.nodeid, "location": item.location}
        item.ihook.pytest_runtest_logstart(**where)
        for _ in range(ATTEMPTS):
            self._target.begin(item)
            with StallMonitor() as stalls:
                reports = runtestprotocol(item, log=False, nextitem=nextitem)
            if any(map(_is_undecided, reports)):
                continue
            stalled = self._target.real_time and stalls.longest_s > STALL_S
            if not (stalled and any(report.failed for report in reports)):
                break
            if item.name not in self.repeated:
                self.repeated.append(item.name)
            self._target.clear(item)
            _wait_calm()
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(**where)
        return True

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Name the tests that were repeated."""
        for name in self.repeated:
            terminalreporter.write_line(f"repeated, the computer stalled: {name}")


class RealTimeFolders:
    """Target: all tests of some folders; a further attempt gets new fixtures.

    Args:
        root: folder of tests.
        folders: those below it whose tests run in real time.
    """

    def __init__(self, root: Path, folders: Collection[str]) -> None:
        self._root, self._folders = root, folders
        self.real_time = False

    def begin(self, item: pytest.Item) -> None:
        inside = item.path.is_relative_to(self._root)
        self.real_time = inside and item.path.relative_to(self._root).parts[0] in self._folders

    def clear(self, item: pytest.Item) -> None:
        """End all fixtures; what that raises follows from the failure."""
        with suppress(Exception):
            item.session._setupstate.teardown_exact(None)  # noqa: SLF001 — no public way


def _is_undecided(report: pytest.TestReport) -> bool:
    return isinstance(report.longrepr, tuple) and UNDECIDED in report.longrepr[2]


def _wait_calm() -> None:
    """Wait until the computer has not stalled for ``CALM_S``, at most ``PATIENCE_S``."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        with StallMonitor() as stalls:
            time.sleep(CALM_S)
        if stalls.longest_s < STALL_S:
            return
