"""The benchmark, the soak test and the fuzzer still run; what they judge is not judged here."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]


def run(module: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", module, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_benchmark_measures_a_served_robot(tmp_path: Path) -> None:
    done = run("tools.bench", "--seconds", "1", "--only", "robotd-500", "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    results = json.loads((tmp_path / "latest.json").read_text())
    assert results["subjects"]["robotd-500"]["periods"] > 0


def test_the_soak_test_serves_clients_and_reports(tmp_path: Path) -> None:
    done = run("tools.endurance.soak", "--minutes", "0.1", "--out", str(tmp_path))
    assert done.returncode in (0, 1), done.stdout + done.stderr  # 1: a bound of a quiet machine
    results = json.loads((tmp_path / "soak-cr3a-sim.json").read_text())
    assert results["counts"]["results"] > 0


def test_the_fuzzer_finds_nothing_in_three_seconds() -> None:
    done = run("tools.fuzz", "--minutes", "0.05")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 findings" in done.stdout
