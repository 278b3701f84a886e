"""A check in real time that fails on a busy computer is repeated; a fault stays a fault."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from robotd.testing.conformance import busy_computer
from robotd.testing.conformance.busy_computer import ATTEMPTS, BusyComputer

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
    """Stands in for ``KitTarget``."""

    real_time = False
    cleared = 0

    def __init__(self, lives_by_clock: bool) -> None:
        self.lives_by_clock = lives_by_clock

    def clear(self) -> None:
        self.cleared += 1


class Reports:
    def __init__(self) -> None:
        self.outcomes: dict[str, list[str]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            name = report.nodeid.rpartition("::")[2]
            self.outcomes.setdefault(name, []).append(report.outcome)


def run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, *, waited_s: float, lives_by_clock: bool = False
) -> tuple[dict[str, list[str]], BusyComputer, Target]:
    """Outcomes of CHECKS on a computer where each attempt waits ``waited_s`` for a processor."""
    file = folder / f"test_{folder.name}.py"  # pytest keeps modules by name
    file.write_text(CHECKS, encoding="utf-8")
    times_s = itertools.count(0.0, waited_s)
    monkeypatch.setattr(busy_computer, "processor_wait_s", lambda: next(times_s))
    target, reports = Target(lives_by_clock), Reports()
    busy = BusyComputer(target)
    arguments = [str(file), "--config-file=/dev/null", f"--rootdir={folder}", "-qq"]
    pytest.main([*arguments, "-pno:cacheprovider"], plugins=[busy, reports])
    return reports.outcomes, busy, target


def test_a_fault_of_the_computer_is_repeated_and_one_of_the_backend_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes, busy, target = run(tmp_path, monkeypatch, waited_s=0.1)
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
    outcomes, busy, _ = run(tmp_path, monkeypatch, waited_s=0.001)
    assert outcomes["test_fails_once"] == ["failed"]
    assert busy.repeated == []


def test_in_simulated_time_nothing_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes, busy, _ = run(tmp_path, monkeypatch, waited_s=0.1, lives_by_clock=True)
    assert outcomes["test_fails_once"] == ["failed"]
    assert busy.repeated == []


def test_the_wait_for_a_processor_is_known() -> None:
    first = busy_computer.processor_wait_s()
    assert 0.0 <= first <= busy_computer.processor_wait_s()
