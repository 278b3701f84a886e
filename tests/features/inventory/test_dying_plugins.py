"""A plugin that ends the process is named, and hides no other."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from robotd.cli.exit_codes import ExitCode
from robotd_shared import foreign_process
from robotd_shared.foreign_process import run_noted

ORIGIN = "plugin 'odd' (odd_module of odd 1.0)"
AT_IMPORT = "import os\nos._exit(9)\n"
AT_OPEN = """
import os
from robotd.api import BackendInfo, Capability, hookimpl
from tests.fakes import FakeAxes, FakeDevice

class Device(FakeDevice):
    def open(self, path="", name=""):
        os._exit(9)

@hookimpl
def robotd_backend(): return BackendInfo("dies", 1)

@hookimpl
def robotd_open_device(): return Device()

@hookimpl
def robotd_axes(): return FakeAxes(3)
"""
IN_A_HOOK = AT_OPEN.replace("return FakeAxes(3)", "os.kill(os.getpid(), 11)")


def robotd(folder: Path, source: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """``robotd`` in a process, with ``source`` as the backend ``odd``."""
    info = folder / "odd-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: odd\nVersion: 1.0\n", "utf-8")
    (info / "entry_points.txt").write_text("[robotd.backends]\nodd = odd_module\n", "utf-8")
    (folder / "odd_module.py").write_text(source, "utf-8")
    return subprocess.run(
        [sys.executable, "-m", "robotd", *arguments],
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=50,
    )


def test_one_that_ends_the_process_hides_no_other(tmp_path: Path) -> None:
    done = robotd(tmp_path, AT_IMPORT, "backends", "--json")
    assert done.returncode == 0, done.stderr
    rows = {row["name"]: row for row in json.loads(done.stdout)}
    assert rows["sim"]["problem"] is None
    assert rows["odd"]["problem"] == (
        f"{ORIGIN} ended the process with status 9 while being imported and described"
    )


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (AT_IMPORT, "ended the process with status 9 while the import"),
        (IN_A_HOOK, "ended the process with signal SIGSEGV while making the drivers"),
    ],
)
def test_the_doctor_names_the_step(source: str, says: str, tmp_path: Path) -> None:
    done = robotd(tmp_path, source, "backends", "--check", "odd")
    assert done.returncode == ExitCode.PLUGIN
    assert f"{ORIGIN} {says}" in done.stdout
    assert "1 problem" in done.stdout


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (AT_IMPORT, "with status 9 while being imported and described"),
        (AT_OPEN, "with status 9 while running test_values_are_fresh"),
    ],
)
def test_the_checks_name_the_one_that_it_ended_in(source: str, says: str, tmp_path: Path) -> None:
    arguments = ("conform", "--backend", "odd", "-k", "values_are_fresh")
    done = robotd(tmp_path, source, *arguments)
    assert done.returncode == ExitCode.PLUGIN
    assert f"{ORIGIN} ended the process {says}" in done.stderr


def test_the_checks_show_what_a_hook_has_raised(tmp_path: Path) -> None:
    source = AT_OPEN.replace("return FakeAxes(3)", "raise AttributeError('no such axis')")
    done = robotd(tmp_path, source, "conform", "--backend", "odd")
    assert done.returncode == ExitCode.PLUGIN
    assert f"{ORIGIN}: robotd_axes failed: AttributeError: no such axis" in done.stdout
    assert "INTERNALERROR" not in done.stdout + done.stderr
    assert "ended the process" not in done.stderr


def test_a_child_that_notes_nothing_any_more_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foreign_process, "STEP_LIMIT_S", 0.5)
    command = [sys.executable, "-c", "import time; time.sleep(40)"]
    status, _, step = run_noted(command, capture=True)
    assert status < 0
    assert step == "starting Python"


def test_plugins_shows_what_each_distribution_adds_and_what_is_wrong(tmp_path: Path) -> None:
    done = robotd(tmp_path, AT_OPEN, "plugins")
    assert done.returncode == 0, done.stderr
    own, foreign = done.stdout.split("\nodd 1.0\n")
    assert own.startswith("robotd ")
    assert "  feature       foxglove, metrics, page" in own
    assert "wrong" not in done.stdout
    assert foreign.splitlines()[0] == "  backend       odd"


@pytest.mark.parametrize(
    ("source", "status", "problem"),
    [
        (AT_OPEN, ExitCode.OK, None),
        (
            AT_IMPORT,
            ExitCode.PLUGIN,
            f"odd 1.0 ended the process with status 9 while {ORIGIN} is imported and examined",
        ),
        (
            "import nothing_here",
            ExitCode.PLUGIN,
            f"{ORIGIN} cannot be imported: ModuleNotFoundError: No module named 'nothing_here'",
        ),
    ],
)
def test_one_distribution_is_checked(
    tmp_path: Path, source: str, status: ExitCode, problem: str | None
) -> None:
    done = robotd(tmp_path, source, "plugins", "--json", "--check", "odd")
    [found] = json.loads(done.stdout)
    assert found["name"] == "odd"
    assert [problem.removesuffix(" (odd_module.py:1)") for problem in found["problems"]] == (
        [problem] if problem else []
    )
    assert done.returncode == status
