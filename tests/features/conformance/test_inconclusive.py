"""A check that fails on a stalled computer is repeated later; a fault stays a fault."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robotd.api import MonotonicClock, wait_until
from robotd_conformance.checks import inconclusive
from robotd_conformance.checks.inconclusive import ATTEMPTS, STALL_S, Repeats, StallMonitor

CHECKS = """
import pytest
from itertools import count
from robotd_conformance.checks.inconclusive import CERTAIN, STALL_S, UNDECIDED
attempts, looks = count(1), count(1)
def test_fails_once():
    assert next(attempts) > 1
def test_cannot_judge_once():
    if next(looks) == 1:
        pytest.skip(UNDECIDED)
def test_never_judges():
    pytest.skip(UNDECIDED)
def test_always_fails():
    assert False, "a fault"
def test_certain():
    assert False, f"a fault: {CERTAIN}"
def test_passes():
    pass
"""


class Target:
    """Target that counts; stands in for ``KitTarget``."""

    cleared = 0
    stall_s = STALL_S

    def __init__(self, real_time: bool, stray: str, refused: str) -> None:
        self.real_time, self.stray, self.refused = real_time, stray, refused

    def begin(self, item: pytest.Item) -> None:
        pass

    def clear(self, item: pytest.Item) -> None:
        self.cleared += 1


class Reports:
    """Outcomes by name, and the order in which attempts were made."""

    def __init__(self) -> None:
        self.outcomes: dict[str, str] = {}
        self.reasons: dict[str, str] = {}
        self.calls: list[str] = []

    def pytest_runtest_call(self, item: pytest.Item) -> None:
        self.calls.append(item.name)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            name = report.nodeid.rpartition("::")[2]
            assert name not in self.outcomes, "reported twice"
            self.outcomes[name] = report.outcome
            self.reasons[name] = str(report.longrepr)


def run(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    stall_s: float,
    real_time: bool = True,
    stray: str = "",
    refused: str = "",
) -> tuple[Reports, Repeats]:
    """Run CHECKS on a computer that stalls for ``stall_s`` during each attempt."""

    def observe(monitor: StallMonitor, *_: object) -> None:
        monitor._end.set()
        monitor._thread.join()
        monitor.longest_s = stall_s

    file = folder / f"test_{folder.name}.py"  # pytest keeps modules by name
    file.write_text(CHECKS, encoding="utf-8")
    monkeypatch.setattr(StallMonitor, "__exit__", observe)
    monkeypatch.setattr(inconclusive, "_wait_calm", lambda: None)
    reports, repeats = Reports(), Repeats(Target(real_time, stray, refused))
    arguments = [str(file), "--config-file=/dev/null", f"--rootdir={folder}", "-qq"]
    pytest.main([*arguments, "-pno:cacheprovider"], plugins=[repeats, reports])
    return reports, repeats


def test_what_failed_on_a_stalled_computer_is_repeated_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reports, repeats = run(tmp_path, monkeypatch, stall_s=2 * STALL_S)
    assert reports.outcomes == {
        "test_fails_once": "passed",
        "test_cannot_judge_once": "passed",
        "test_never_judges": "skipped",
        "test_always_fails": "skipped",
        "test_certain": "failed",
        "test_passes": "passed",
    }
    assert "inconclusive" in reports.reasons["test_always_fails"]
    assert "a fault" in reports.reasons["test_always_fails"]
    assert reports.calls.index("test_passes") < len(reports.calls) - ATTEMPTS
    assert reports.calls.count("test_always_fails") == ATTEMPTS
    assert set(repeats.repeated) == set(reports.outcomes) - {"test_certain", "test_passes"}
    stalled = "repeated 2×, the computer stalled for up to 30 ms, limit 15 ms: test_always_fails"
    assert stalled in capsys.readouterr().out


@pytest.mark.parametrize(
    ("stall_s", "real_time", "stray"),
    [(0.5 * STALL_S, True, ""), (9.0, False, ""), (9.0, True, "joint1 is 0.5 rad away")],
)
def test_a_fault_on_a_calm_computer_or_in_stepped_time_or_of_a_robot_gone_astray_fails_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stall_s: float, real_time: bool, stray: str
) -> None:
    reports, repeats = run(tmp_path, monkeypatch, stall_s=stall_s, real_time=real_time, stray=stray)
    assert reports.outcomes["test_always_fails"] == "failed"
    assert reports.outcomes["test_fails_once"] == "failed"
    assert "test_always_fails" not in repeats.repeated


def test_a_check_whose_command_was_refused_has_neither_passed_nor_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever it makes of the error; and it is not repeated."""
    reports, repeats = run(tmp_path, monkeypatch, stall_s=9.0, refused="a move to 3.04 rad")
    assert set(reports.outcomes.values()) == {"skipped"}
    assert "refused by the kit: a move to 3.04 rad" in reports.reasons["test_passes"]
    assert not repeats.repeated


def test_a_monitor_sees_a_stall_of_the_process() -> None:
    with StallMonitor() as stalls:
        for _ in range(20):  # a busy computer may let the monitor begin late
            time.sleep(0.01)
            sum(range(4_000_000))  # one call of C: no other thread runs
            if stalls.longest_s > 0.01:
                break
    assert stalls.longest_s > 0.01
    assert not stalls._thread.is_alive()


def test_a_monitor_sees_that_a_process_which_was_started_waits_for_a_processor() -> None:
    busy = [sys.executable, "-c", "while True: pass"]
    processes = [subprocess.Popen(busy) for _ in range(4)]
    try:
        with StallMonitor() as stalls:
            for process in processes:
                os.sched_setaffinity(process.pid, {min(os.sched_getaffinity(0))})
            assert wait_until(lambda: stalls.longest_s > STALL_S, 40.0, MonotonicClock())
    finally:
        for process in processes:
            process.kill()
            process.wait()
