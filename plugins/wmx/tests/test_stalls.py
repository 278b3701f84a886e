"""A robot whose process is stopped and continued while the engine goes on: no axis leaps."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from tools.endurance.stalls import run


def test_no_axis_leaps_when_the_process_is_stopped() -> None:
    verdict = run("wmx", times=15, span_s=(0.003, 0.12), seed=5)
    assert verdict.goals >= 1
    assert (verdict.leaps, verdict.reversals, verdict.jerks) == (0, 0, 0), verdict
