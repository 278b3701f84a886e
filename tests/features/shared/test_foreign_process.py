"""Process of a foreign plugin, watched by its notes."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from robotd_shared import foreign_process
from robotd_shared.foreign_process import STEP_LIMIT_S, run_noted

LOOKS = 3  # of the parent, until the child may end
CHILD = """
import pathlib, sys, time
while not pathlib.Path(sys.argv[1]).exists():
    time.sleep(0.01)
"""


@pytest.mark.parametrize(
    ("clock_set_s", "passed_s", "status"), [(1e6, 0.0, 0), (0.0, STEP_LIMIT_S, -9)]
)
def test_a_child_is_killed_for_the_time_that_passes_and_not_for_a_clock_that_is_set(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    clock_set_s: float,
    passed_s: float,
    status: int,
) -> None:
    looks = 0

    def now_s() -> float:
        nonlocal looks
        looks += 1
        if looks == LOOKS and not passed_s:
            (tmp_path / "end").touch()
        return looks * passed_s

    clock = SimpleNamespace(time=lambda: now_s() + time.time() + clock_set_s, monotonic=now_s)
    monkeypatch.setattr(foreign_process, "time", clock)
    command = [sys.executable, "-c", CHILD, str(tmp_path / "end")]
    assert run_noted(command, capture=True)[0] == status
