"""A test in real time that fails on a stalled computer is repeated; a fault stays a fault."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from robotd_conformance import busy_computer
from robotd_conformance.busy_computer import (
    ATTEMPTS,
    STALL_S,
    BusyComputer,
    RealTimeFolders,
    StallMonitor,
)

CHECKS = """
from itertools import count
attempts = count(1)
def test_fails_once():
    assert next(attempts) > 1
def test_always_fails():
    assert False
def test_passes():
    pass
"""


class Target:
    """Target that counts; stands in for ``KitTarget``."""

    cleared = 0

    def __init__(self, real_time: bool) -> None:
        self.real_time = real_time

    def begin(self, item: pytest.Item) -> None:
        pass

    def clear(self, item: pytest.Item) -> None:
        self.cleared += 1


class Reports:
    def __init__(self) -> None:
        self.outcomes: dict[str, list[str]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            name = report.nodeid.rpartition("::")[2]
            self.outcomes.setdefault(name, []).append(report.outcome)


def observe(monitor: StallMonitor, stall_s: float) -> None:
    monitor._end.set()
    monitor._thread.join()
    monitor.longest_s = stall_s


def run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, *, stall_s: float, real_time: bool = True
) -> tuple[dict[str, list[str]], BusyComputer, Target]:
    """Outcomes of CHECKS on a computer that stalls for ``stall_s`` during each attempt."""
    file = folder / f"test_{folder.name}.py"  # pytest keeps modules by name
    file.write_text(CHECKS, encoding="utf-8")
    monkeypatch.setattr(StallMonitor, "__exit__", lambda self, *_: observe(self, stall_s))
    monkeypatch.setattr(busy_computer, "_wait_calm", lambda: None)
    target, reports = Target(real_time), Reports()
    busy = BusyComputer(target)
    arguments = [str(file), "--config-file=/dev/null", f"--rootdir={folder}", "-qq"]
    pytest.main([*arguments, "-pno:cacheprovider"], plugins=[busy, reports])
    return reports.outcomes, busy, target


def test_a_fault_of_the_computer_is_repeated_and_one_of_the_backend_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes, busy, target = run(tmp_path, monkeypatch, stall_s=2 * STALL_S)
    assert outcomes == {
        "test_fails_once": ["passed"],
        "test_always_fails": ["failed"],
        "test_passes": ["passed"],
    }
    assert busy.repeated == ["test_fails_once", "test_always_fails"]
    assert target.cleared == 1 + ATTEMPTS


def test_on_an_idle_computer_nothing_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes, busy, _ = run(tmp_path, monkeypatch, stall_s=STALL_S / 2)
    assert outcomes["test_fails_once"] == ["failed"]
    assert busy.repeated == []


def test_in_simulated_time_nothing_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes, busy, _ = run(tmp_path, monkeypatch, stall_s=2 * STALL_S, real_time=False)
    assert outcomes["test_fails_once"] == ["failed"]
    assert busy.repeated == []


def test_a_monitor_sees_a_stall_of_the_process() -> None:
    with StallMonitor() as stalls:
        time.sleep(0.01)
        sum(range(4_000_000))  # one call of C: no other thread runs
    assert stalls.longest_s > 0.01
    assert not stalls._thread.is_alive()


NEW_FIXTURES = """
import pytest
from itertools import count
made = count(1)
@pytest.fixture(scope="session")
def robot():
    return next(made)
def test_needs_a_new_robot(robot):
    assert robot > 1
"""


def test_a_further_attempt_gets_new_fixtures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "ros"
    folder.mkdir()
    file = folder / "test_new_fixtures.py"
    file.write_text(NEW_FIXTURES, encoding="utf-8")
    monkeypatch.setattr(StallMonitor, "__exit__", lambda self, *_: observe(self, 2 * STALL_S))
    monkeypatch.setattr(busy_computer, "_wait_calm", lambda: None)
    busy, reports = BusyComputer(RealTimeFolders(tmp_path, ["ros"])), Reports()
    arguments = [str(file), "--config-file=/dev/null", f"--rootdir={tmp_path}", "-qq"]
    pytest.main([*arguments, "-pno:cacheprovider"], plugins=[busy, reports])
    assert reports.outcomes == {"test_needs_a_new_robot": ["passed"]}
    assert busy.repeated == ["test_needs_a_new_robot"]


UNDECIDED_CHECKS = """
import pytest
from itertools import count
from robotd_conformance.busy_computer import UNDECIDED
attempts = count(1)
def test_undecided_once():
    if next(attempts) == 1:
        pytest.skip(UNDECIDED)
def test_never_decided():
    pytest.skip(UNDECIDED)
def test_skipped():
    assert next(attempts) == 3
    pytest.skip("no joints")
"""


def test_what_is_undecided_is_repeated_and_skipped_in_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "CHECKS", UNDECIDED_CHECKS)
    outcomes, busy, target = run(tmp_path, monkeypatch, stall_s=0.0)
    assert outcomes == {
        "test_undecided_once": ["passed"],
        "test_never_decided": ["skipped"],
        "test_skipped": ["skipped"],
    }
    assert busy.repeated == []
    assert target.cleared == 0
