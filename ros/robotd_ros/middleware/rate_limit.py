"""Token bucket for the executor time spent on one subscription.

Works around: the EventsExecutor keeps an event for each message, so that a topic that floods it
delays every service more and more; a wait set would drop what exceeds the queue.
Measured: worst round trip of a service during a flood of 3 s, with a handler of 0.3 ms: 0.26 s
with the limit, 1.1 s without (x86_64, two cores at load 7).
Upstream: https://github.com/ros2/rclcpp/issues/3213 (the same of its executor in C++; open).
Ends with: no version yet.
Shown by: tests/ros/unit/test_rate_limit.py, tests/ros/test_bad_clients.py.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

BURST_S = 0.1
MAX_CHARGE_S = 0.002
NEWS_SILENCE_S = 1.0

Item = TypeVar("Item")


class RateLimit:
    """Token bucket: refills at ``share`` of the time, holds at most ``BURST_S``. One thread.

    Attributes:
        is_news: whether the last rejection was the first for ``NEWS_SILENCE_S``.
    """

    def __init__(self, share: float) -> None:
        self.is_news = False
        self._share = share
        self._left_s = BURST_S
        self._seen_s = time.monotonic()
        self._rejected_s = -NEWS_SILENCE_S

    def is_left(self) -> bool:
        """Return True while tokens are left for one more message, however long it takes."""
        now_s = time.monotonic()
        earned_s = (now_s - self._seen_s) * self._share
        self._left_s = min(BURST_S, self._left_s + earned_s)
        self._seen_s = now_s
        if self._left_s > 0.0:
            return True
        self.is_news = now_s - self._rejected_s >= NEWS_SILENCE_S
        self._rejected_s = now_s
        return False

    @contextmanager
    def spent(self) -> Iterator[None]:
        """Charge the time that the block takes, but no more than ``MAX_CHARGE_S``.

        What takes long once, such as the log of an exception, must not cost those that follow.
        """
        began_s = time.monotonic()
        try:
            yield
        finally:
            self._left_s -= min(time.monotonic() - began_s, MAX_CHARGE_S)


class NewestItems(Generic[Item]):
    """Items in the order of their arrival, without those all of whose targets have newer ones.

    So there are no more items than targets. One thread.
    """

    def __init__(self) -> None:
        self._items: list[tuple[frozenset[int], Item]] = []

    def put(self, targets: frozenset[int], item: Item) -> None:
        """Add ``item``, which replaces those before for its ``targets``, at least one."""
        older = [(item - targets, kept) for item, kept in self._items]
        self._items = [(left, kept) for left, kept in older if left] + [(targets, item)]

    def pop(self) -> Item:
        """Remove and return the oldest item."""
        return self._items.pop(0)[1]

    def __bool__(self) -> bool:
        return bool(self._items)
