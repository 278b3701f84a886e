"""A test that exceeds its time fails; the session goes on, whatever the phase."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
TESTS = """
import time, pytest

@pytest.fixture
def slow_set_up():
    time.sleep(9)

@pytest.fixture
def slow_end():
    yield
    time.sleep(9)

def test_slow_set_up(slow_set_up): pass
def test_slow(): time.sleep(9)
def test_slow_end(slow_end): pass
def test_slow_report(): pass
def test_last(): pass
"""
CONFTEST = """
import time
from tests.time_limits import TimeLimits

def pytest_configure(config):
    config.pluginmanager.register(TimeLimits())

def pytest_runtest_logreport(report):
    if "slow_report" in report.nodeid and report.when == "setup":
        time.sleep(0.8)  # a stall between two phases
"""
SETTINGS = "[pytest]\ntimeout = 0.5\ntimeout_func_only = true\n"


def test_a_time_out_ends_one_test_and_not_the_session(tmp_path: Path) -> None:
    (tmp_path / "test_x.py").write_text(TESTS, encoding="utf-8")
    (tmp_path / "conftest.py").write_text(CONFTEST, encoding="utf-8")
    (tmp_path / "pytest.ini").write_text(SETTINGS, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-rA", "-p", "no:cacheprovider", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    summary = done.stdout.partition("short test summary info")[2]
    assert "INTERNALERROR" not in done.stdout + done.stderr
    outcomes = {
        line.split("::")[1].split()[0]: line.split()[0]
        for line in summary.splitlines()
        if "::" in line and not line.endswith("PASSED")
    }
    assert outcomes == {
        "test_slow_set_up": "ERROR",
        "test_slow": "FAILED",
        "test_slow_end": "ERROR",
        "test_slow_report": "PASSED",
        "test_last": "PASSED",
    }
