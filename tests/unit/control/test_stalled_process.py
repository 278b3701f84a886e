"""A robot whose process is stopped and continued, in real time: no motor leaps."""

from __future__ import annotations

from tools.endurance.stalls import run


def test_no_motor_leaps_when_the_process_is_stopped() -> None:
    """Before the mend 20 stalls led to some ten leaps of up to 25 rad/s."""
    verdict = run("sim", times=20, span_s=(0.003, 0.12), seed=5)
    assert verdict.goals >= 1
    assert (verdict.leaps, verdict.reversals, verdict.jerks) == (0, 0, 0), verdict
