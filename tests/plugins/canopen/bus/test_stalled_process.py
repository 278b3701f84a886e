"""A robot whose process is stopped and continued, with drives in another: no motor leaps."""

from __future__ import annotations

from tools.endurance.stalls import run

# Of 20 stalls. A setpoint is executed from rest when the process is stopped right before its SYNC
# leaves: one stall in a hundred on a loaded computer, see the decision "After a stall".
JERKS = 2


def test_no_drive_leaps_when_the_process_is_stopped() -> None:
    verdict = run("canopen", times=20, span_s=(0.003, 0.12), seed=5)
    assert verdict.goals >= 1
    assert (verdict.leaps, verdict.reversals) == (0, 0), verdict
    assert verdict.jerks <= JERKS, verdict
