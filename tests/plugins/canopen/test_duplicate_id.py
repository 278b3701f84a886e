"""Heartbeats of two nodes with one id."""

from __future__ import annotations

from robotd_canopen.node import HeartbeatRate

PERIOD_S, STEP_NS = 0.1, 10_000_000


def found_after(counts: list[int], period_s: float = PERIOD_S) -> bool:
    """Return the verdict after ``counts`` heartbeats in each 10 ms."""
    rate, total, found = HeartbeatRate(), 0, False
    rate.period_s = period_s
    for step, count in enumerate(counts, start=1):
        total += count
        found = rate.is_doubled(total, step * STEP_NS)
    return found


def every(period: int, steps: int) -> list[int]:
    return [int(step % period == 0) for step in range(steps)]


def test_heartbeats_as_reported_are_of_one_node() -> None:
    assert not found_after(every(10, 2000))


def test_heartbeats_at_twice_the_rate_are_of_two() -> None:
    assert found_after(every(5, 1000))


def test_heartbeats_that_waited_during_a_stall_are_of_one_node() -> None:
    assert not found_after([*every(10, 400), 100, *every(10, 250)])


def test_a_node_without_a_heartbeat_period_is_not_judged() -> None:
    assert not found_after(every(5, 1000), period_s=0.0)
