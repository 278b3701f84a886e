"""Robot whose process is stopped and continued in real time: no motor jumps."""

from __future__ import annotations

from tools.endurance.stalls import run

# Of 20 stalls. A setpoint is executed from rest when the process is stopped between the check that
# it is in time and its way to the drive, see the decision "After a stall"; on a busy computer it is
# on that way for longer.
JERKS = 4


def test_no_motor_jumps_when_the_process_is_stopped() -> None:
    """Without stall recovery 20 stalls caused some ten jumps of up to 25 rad/s."""
    verdict = run("sim", times=20, span_s=(0.003, 0.12), seed=5)
    assert verdict.goals >= 1
    assert (verdict.leaps, verdict.reversals) == (0, 0), verdict
    assert verdict.jerks <= JERKS, verdict
