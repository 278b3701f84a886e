"""The judge of a drive finds what it is there for, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from tests.witness.judge import Command, Judge

PERIOD_S = 0.01
VELOCITY, ACCELERATION = 2.0, 10.0  # limits: 20 mrad in a period, 1 mrad more than before


def judged(targets: Sequence[float], silent: dict[int, int] | None = None) -> list[str]:
    """Return the findings for targets in mrad; ``silent``: periods before a target, by number."""
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, may_enable=True)
    judge.power(0.0, True)
    time_s = 0.0
    for number, target in enumerate(targets):
        time_s += PERIOD_S * (1 + (silent or {}).get(number, 0))
        judge.execute(Command(time_s, target / 1000, sent_s=time_s, place=0.0))
    return judge.findings


def test_a_ramp_at_the_limits_is_right() -> None:
    steps = [*range(21), *[20] * 20, *range(20, -1, -1)]
    assert judged([sum(steps[:end]) for end in range(len(steps))]) == []


def test_a_step_is_found_with_its_way_back() -> None:
    found = judged([0.0, 0.0, 100.0, 0.0, 0.0])
    assert sum("rad in a period" in finding for finding in found) == 2
    assert "+10.0 rad/s" in found[0]


def test_a_change_of_speed_is_found() -> None:
    [first, *_] = judged([0.0, 0.0, 5.0, 10.0])
    assert "changes by +50 rad/s²" in first


@pytest.mark.parametrize(("step", "count"), [(0.0, 0), (20.0, 0), (30.0, 1)])
def test_after_a_silence_the_way_counts_and_its_ramp_does_not(step: float, count: int) -> None:
    found = judged([0.0, 1.0, 2.0, 2.0 + step, 2.0 + step], {3: 20})
    steps = [finding for finding in found if "after a silence of 0.210 s" in finding]
    assert len(steps) == count


@pytest.mark.parametrize(("step", "found"), [(60.0, False), (80.0, True)])
def test_a_joint_that_coasts_is_judged_by_the_time_of_a_silence(step: float, found: bool) -> None:
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, may_enable=True, coast_s=3 * PERIOD_S)
    judge.power(0.0, True)
    judge.execute(Command(0.0, 0.0))
    judge.execute(Command(10 * PERIOD_S, step / 1000))
    assert bool(judge.findings) is found


def test_a_drive_that_goes_on_by_itself_is_found() -> None:
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S)
    judge.power(0.0, True)
    assert "is switched on without a request" in judge.findings[0]


def test_an_old_command_is_found() -> None:
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, may_enable=True)
    judge.execute(Command(1.0, 0.0, sent_s=0.97))
    assert judge.findings == []
    judge.execute(Command(1.01, 0.0, sent_s=0.97))
    assert "executes what was sent 4.0 periods ago" in judge.findings[0]


@pytest.mark.parametrize(("sent_s", "found"), [([1.01], 0), ([1.01, 1.02], 1), ([1.03], 1)])
def test_one_old_command_may_follow_the_one_before_it(sent_s: list[float], found: int) -> None:
    """It was sent right after that one, and more than three periods ago."""
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, may_enable=True, may_wait=1)
    for time_s, sent in zip((1.0, 1.2, 1.21), (1.0, *sent_s), strict=False):
        judge.execute(Command(time_s, 0.0, sent_s=sent))
    assert len(judge.findings) == found


def test_an_old_command_may_follow_a_frame_that_moved_nothing() -> None:
    """The drive braked by itself until then: it got frames, and executed no target."""
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, may_enable=True, may_wait=1)
    judge.execute(Command(1.0, 0.0, sent_s=1.0))
    judge.note_frame(1.1)
    judge.execute(Command(1.2, 0.0, sent_s=1.11))
    assert judge.findings == []


@pytest.mark.parametrize(("target", "found"), [(0.03, 0), (0.034, 1)])
def test_a_drive_that_is_not_heard_may_be_held_at_once(target: float, found: int) -> None:
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, may_enable=True)
    for number in range(4):
        judge.execute(Command(number * PERIOD_S, number * 0.01))
    judge.lose_answer(3 * PERIOD_S)
    judge.findings.clear()
    judge.execute(Command(4 * PERIOD_S, target))
    assert len(judge.findings) == found


def test_motion_after_a_stop_is_found() -> None:
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, may_enable=True, must_rest=True)
    for number in range(3):
        judge.execute(Command(number * PERIOD_S, number * 0.001))
    assert "after a stop" in judge.findings[0]


def test_a_way_out_of_the_limits_is_found_and_the_way_back_is_right() -> None:
    limits = {"lower": -1.0, "upper": 1.0, "may_enable": True}
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, **limits)  # type: ignore[arg-type]
    for number, target in enumerate((1.004, 1.003, 1.001)):
        judge.execute(Command(number * PERIOD_S, target, place=1.005))
    assert judge.findings == []
    judge.execute(Command(3 * PERIOD_S, 1.002))
    assert "is commanded to +1.002 rad" in judge.findings[0]


def test_torque_and_speed_beyond_the_limits_are_found() -> None:
    judge = Judge("joint1", VELOCITY, ACCELERATION, PERIOD_S, torque=5.0, may_enable=True)
    judge.execute(Command(0.0, 6.0, "torque"))
    judge.execute(Command(0.01, 3.0, "velocity"))
    judge.profile(0.02, 3.0)
    assert len(judge.findings) == 3
