"""A budget gives a share of the time, and no more."""

from __future__ import annotations

import random

import pytest

from robotd_ros.middleware import rate_limit
from robotd_ros.middleware.rate_limit import (
    BURST_S,
    MAX_CHARGE_S,
    NEWS_SILENCE_S,
    NewestItems,
    RateLimit,
)

STEP_S = 1e-4


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time in seconds, as a list of one that a test may change."""
    time_s = [100.0]
    monkeypatch.setattr(rate_limit.time, "monotonic", lambda: time_s[0])
    return time_s


def work(of: RateLimit, now: list[float], seconds: float) -> None:
    with of.spent():
        now[0] += seconds


def test_what_is_in_hand_goes_at_once_and_then_nothing(now: list[float]) -> None:
    some, done = RateLimit(0.2), 0
    while some.is_left():
        with some.spent():
            now[0] += 1e-3
        done += 1
    assert done == pytest.approx(BURST_S / 1e-3 / 0.8, abs=2)  # 0.2 was earned meanwhile
    assert some.is_news


def test_a_flood_gets_its_share(now: list[float]) -> None:
    some, worked_s, began_s = RateLimit(0.2), 0.0, now[0]
    while now[0] - began_s < 10.0:
        if some.is_left():
            work(some, now, 1e-3)
            worked_s += 1e-3
        else:
            now[0] += STEP_S
    assert worked_s == pytest.approx(0.2 * 10.0 + BURST_S, abs=0.01)
    assert not some.is_news


def test_nothing_is_rejected_below_the_share(now: list[float]) -> None:
    some = RateLimit(0.2)
    for _ in range(1000):
        assert some.is_left()
        work(some, now, 1e-4)
        now[0] += 9e-4


def test_no_more_is_saved_than_is_in_hand(now: list[float]) -> None:
    some, done = RateLimit(0.2), 0
    now[0] += 3600.0
    while some.is_left():
        work(some, now, MAX_CHARGE_S)
        done += 1
    assert done == pytest.approx(BURST_S / MAX_CHARGE_S / 0.8, abs=1)


def test_one_that_takes_long_does_not_cost_those_that_follow(now: list[float]) -> None:
    some = RateLimit(0.2)
    work(some, now, 10.0)
    assert some.is_left()


def test_a_refusal_is_news_after_a_quiet_time(now: list[float]) -> None:
    some = RateLimit(0.001)
    while some.is_left():
        work(some, now, MAX_CHARGE_S)
    assert some.is_news
    assert not some.is_left()
    assert not some.is_news
    now[0] += NEWS_SILENCE_S  # earns half of what one costs
    work(some, now, MAX_CHARGE_S)
    assert not some.is_left()
    assert some.is_news


def test_what_is_left_is_the_newest_for_each_target() -> None:
    items: NewestItems[str] = NewestItems()
    for targets, item in [({1, 2}, "a"), ({3}, "b"), ({2}, "c"), ({3}, "d"), ({2, 3}, "e")]:
        items.put(frozenset(targets), item)
    assert [items.pop() for _ in range(2)] == ["a", "e"]  # "a" is the newest one for 1
    assert not items


def test_there_are_no_more_items_than_targets() -> None:
    items, chance = NewestItems[int](), random.Random(1)
    newest: dict[int, int] = {}
    for number in range(1000):
        targets = frozenset(chance.sample(range(8), chance.randint(1, 8)))
        items.put(targets, number)
        newest |= dict.fromkeys(targets, number)
    left = []
    while items:
        left.append(items.pop())
    assert left == sorted(set(newest.values()))
