"""The clock on which waiting runs the cycle."""

from __future__ import annotations

from robotd.clock import wait_until
from robotd.testing.stepping import SteppedClock


def test_sleeping_lives_through_every_period() -> None:
    clock, times_ns = SteppedClock(500.0), list[int]()
    clock.step = times_ns.append
    start_ns = clock.now_ns()
    clock.sleep_until_ns(start_ns + 10_000_000)
    assert [time_ns - start_ns for time_ns in times_ns] == [n * 2_000_000 for n in range(1, 6)]
    assert clock.now_ns() == start_ns + 10_000_000


def test_waiting_runs_until_the_condition_holds() -> None:
    clock, steps = SteppedClock(1000.0), list[int]()
    clock.step = steps.append
    assert wait_until(lambda: len(steps) >= 3, 1.0, clock, 0.001)
    assert len(steps) == 3
    assert not wait_until(lambda: False, 0.5, clock)


def test_a_period_that_sleeps_makes_others_missed_not_late() -> None:
    clock, times_ns = SteppedClock(1000.0), list[int]()

    def slow(time_ns: int) -> None:
        times_ns.append(time_ns)
        if len(times_ns) == 1:
            clock.sleep_until_ns(time_ns + 5_500_000)

    clock.step = slow
    start_ns = clock.now_ns()
    clock.sleep_until_ns(start_ns + 8_000_000)
    assert [(time_ns - start_ns) // 1_000_000 for time_ns in times_ns] == [1, 6, 7, 8]


def test_time_does_not_go_back() -> None:
    clock = SteppedClock(1000.0)
    before_ns = clock.now_ns()
    clock.sleep_until_ns(before_ns - 5)
    assert clock.now_ns() == before_ns
