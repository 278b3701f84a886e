"""Repeats checks in real time that a busy computer did not let judge."""

from __future__ import annotations

import os
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Protocol, Self

import pytest
from _pytest.runner import runtestprotocol

UNDECIDED = "inconclusive: the computer was too busy to judge"
"""A check that skips itself with this reason is repeated."""
CERTAIN = "no stall of the computer explains it"
"""A failure with this text is not repeated."""
REFUSED = "refused by the kit"
"""A check that would have led an axis out of its room."""
ATTEMPTS = 3
STALL_S = 0.015  # a thread that wakes up so late, and others with it
STALL_CHECK_S = 0.005
PROCESSES_CHECKS = 10  # of ``STALL_CHECK_S`` between two looks at the processes
CALM_S, PATIENCE_S = 1.0, 8.0  # without a stall, before a further attempt; how long to wait for it


class StallMonitor:
    """Longest stall of this process, and of those that it started, while the context is open.

    A thread sleeps and looks how late it wakes up. Processor time that other processes take is
    seen as well as time that a host takes from a virtual machine. Simulated drives may be processes
    of their own: how long their threads wait for a processor is read from Linux.

    Attributes:
        longest_s: how late the thread woke up, or another thread waited between two looks, at most.
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
        before_s, waited_s, checks = time.monotonic(), _waited_s(), 0
        while not self._end.wait(STALL_CHECK_S):
            now_s = time.monotonic()
            self.longest_s = max(self.longest_s, now_s - before_s - STALL_CHECK_S)
            checks += 1
            if checks % PROCESSES_CHECKS == 0:
                earlier_s, waited_s = waited_s, _waited_s()
                for thread, total_s in waited_s.items():
                    grown_s = total_s - earlier_s.get(thread, total_s)
                    self.longest_s = max(self.longest_s, grown_s)
                now_s = time.monotonic()
            before_s = now_s


def _waited_s() -> dict[Path, float]:
    """Return how long each thread of the processes that this one started waited for a processor.

    Field 2 of ``schedstat``, see sched-stats.rst of the Linux kernel; empty where there is none.
    """
    waited_s = {}
    for process in _started_by(os.getpid()):
        for thread in Path(f"/proc/{process}/task").glob("*/schedstat"):
            with suppress(OSError, IndexError):  # it has ended
                waited_s[thread] = int(thread.read_text(encoding="ascii").split()[1]) * 1e-9
    return waited_s


def _started_by(process: int) -> Iterator[int]:
    """Yield the processes that ``process`` and those that it started have started."""
    for children in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):  # the thread has ended
            for child in map(int, children.read_text(encoding="ascii").split()):
                yield child
                yield from _started_by(child)


class CheckTarget(Protocol):
    """Target of checks.

    Attributes:
        real_time: the check, or the attempt that has ended, ran in real time.
        stall_s: length of a stall that may make a check fail.
    """

    real_time: bool
    stall_s: float

    @property
    def stray(self) -> str:
        """Reason why the run has to end at once; "" while it may go on."""

    @property
    def refused(self) -> str:
        """Reason why the kit did not execute the check, or the attempt that has ended; ""."""

    def begin(self, item: pytest.Item) -> None:
        """Prepare an attempt of a check."""

    def clear(self, item: pytest.Item) -> None:
        """Remove what an attempt has left behind."""


class Repeats:
    """Plugin of pytest: repeats undecided checks at the end of the run.

    A check cannot be judged where it says so, or where it failed in real time while the computer
    stalled, unless that is ``CERTAIN``: then the control loop and simulated drives came late, too.
    After ``ATTEMPTS`` it is reported as inconclusive, with its failure; a fault of the backend
    fails any attempt that the computer leaves alone.

    Attributes:
        repeated: by name of a check that was put off: longest stall of each such attempt, seconds.
    """

    def __init__(self, target: CheckTarget) -> None:
        self._target = target
        self._attempts: Counter[str] = Counter()
        self.repeated: dict[str, list[float]] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool:
        """Run the check, and report it or put it off."""
        where = {"nodeid": item.nodeid, "location": item.location}
        if self._attempts[item.nodeid]:
            _wait_calm()
        else:
            item.ihook.pytest_runtest_logstart(**where)
        self._attempts[item.nodeid] += 1
        self._target.begin(item)
        with StallMonitor() as stalls:
            reports = runtestprotocol(item, log=False, nextitem=nextitem)
        if refused := self._target.refused:
            reports = [_as_refused(report, refused) for report in reports]
            self._target.clear(item)
        failed = any(report.failed for report in reports)
        certain = any(report.failed and CERTAIN in report.longreprtext for report in reports)
        is_final = certain or not self._target.real_time or bool(self._target.stray)
        stalled = failed and not is_final and stalls.longest_s > self._target.stall_s
        if stalled or any(map(is_undecided, reports)):
            if failed:
                self._target.clear(item)
            if self._attempts[item.nodeid] < ATTEMPTS:
                item.session.items.append(item)  # the loop of pytest comes to it in the end
                self.repeated.setdefault(item.name, []).append(stalls.longest_s)
                return True
            reports = [_as_inconclusive(report, stalls.longest_s) for report in reports]
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(**where)
        return True

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Name the checks that were repeated."""
        limit_ms = 1e3 * self._target.stall_s
        for name, stalls_s in self.repeated.items():
            stall = f"{1e3 * max(stalls_s):.0f} ms, limit {limit_ms:.0f} ms"
            what = f"repeated {len(stalls_s)}×, the computer stalled for up to {stall}"
            terminalreporter.write_line(f"{what}: {name}")


def load() -> str:
    """Return how many threads want a processor, as text."""
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"


def is_undecided(report: pytest.TestReport) -> bool:
    """Return True for a check that could not be judged on a busy computer."""
    return isinstance(report.longrepr, tuple) and UNDECIDED in report.longrepr[2]


def is_refused(report: pytest.TestReport) -> bool:
    """Return True for a check that the kit did not execute."""
    return isinstance(report.longrepr, tuple) and REFUSED in report.longrepr[2]


def _as_refused(report: pytest.TestReport, why: str) -> pytest.TestReport:
    """Turn what was made of an error of the kit into a skip that says why."""
    if report.failed or report.when == "call":
        path, line, _ = report.location
        report.outcome, report.longrepr = "skipped", (path, line or 0, f"Skipped: {REFUSED}: {why}")
    return report


def _as_inconclusive(report: pytest.TestReport, stall_s: float) -> pytest.TestReport:
    """Turn a failure into a skip that says why, and what was seen."""
    if report.failed:
        path, line, _ = report.location
        crash = getattr(report.longrepr, "reprcrash", None)
        seen = str(crash.message if crash else report.longrepr).partition("\n")[0]
        text = (
            f"{UNDECIDED}: it stalled for {1e3 * stall_s:.0f} ms in the last attempt, {load()};"
            f" seen: {seen}"
        )
        report.outcome, report.longrepr = "skipped", (path, line or 0, f"Skipped: {text}")
    return report


def _wait_calm() -> None:
    """Wait until the computer has not stalled for ``CALM_S``, at most ``PATIENCE_S``."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        with StallMonitor() as stalls:
            time.sleep(CALM_S)
        if stalls.longest_s < STALL_S:
            return
