from __future__ import annotations

import tracemalloc
from itertools import count

import numpy as np
import pytest

from robotd.errors import InvalidArgument
from robotd.events import (
    MAX_BYTES,
    MAX_DATA_BYTES,
    MAX_EVENTS,
    OWN_PROCESS,
    EventKind,
    EventLog,
    logged_command,
    sent_by,
)


def log() -> EventLog:
    times = count()
    return EventLog(lambda: next(times))


class Facade:
    def __init__(self) -> None:
        self.events = log()

    @logged_command
    def servo(self, axis: int, on: bool) -> int:
        if axis > 5:
            raise InvalidArgument(f"axis {axis} is outside 0..5")
        return axis


def test_a_reader_gets_each_event_once() -> None:
    events = log()
    for number in range(3):
        events.add(EventKind.LOG, "a", str(number))
    found, cursor = events.since(0)
    assert [event.text for event in found] == ["0", "1", "2"]
    events.add(EventKind.LOG, "a", "3")
    found, cursor = events.since(cursor)
    assert [(event.time_ns, event.text) for event in found] == [(3, "3")]
    assert events.since(cursor) == ([], 4)


def test_the_oldest_events_are_dropped_beyond_the_number() -> None:
    events = log()
    for number in range(MAX_EVENTS + 10):
        events.add(EventKind.LOG, "a", str(number))
    found, cursor = events.since(0)
    assert (len(found) <= MAX_EVENTS, cursor) == (True, MAX_EVENTS + 10)
    assert found[-1].text == str(MAX_EVENTS + 9)
    assert events.counts[EventKind.LOG, ""] == MAX_EVENTS + 10


def test_the_oldest_events_are_dropped_beyond_the_memory() -> None:
    events = log()
    points = np.zeros((3000, 6))  # 144 kB
    for _ in range(100):
        events.add(EventKind.GOAL, "arm", "goal", data={"positions": points})
    assert len(events.since(0)[0]) == MAX_BYTES // (points.nbytes + 1000)


def test_the_memory_of_small_events_is_counted_in_full() -> None:
    tracemalloc.start()
    events = log()
    before = tracemalloc.get_traced_memory()[0]
    for number in range(1000):
        text = f"servo({number}, True)"
        data = {"call": f"servo {number}", "args": [1000 + number, True], "outcome": "accepted"}
        events.add(EventKind.COMMAND, "servo", text, data=data)
    used = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert used < events.nbytes


def test_a_command_is_noted_with_sender_and_arguments() -> None:
    facade = Facade()
    with sent_by("/move_group"):
        assert facade.servo(2, True) == 2
    facade.servo(3, True)
    first, second = facade.events.since(0)[0]
    assert (first.kind, first.subject, first.sender) == (EventKind.COMMAND, "servo", "/move_group")
    assert first.text == "servo: axis 2, on"
    assert first.data == {"call": "servo", "args": [2, True], "outcome": "accepted"}
    assert second.sender == OWN_PROCESS


def test_a_rejected_command_is_noted_with_its_reason_and_raises() -> None:
    facade = Facade()
    with pytest.raises(InvalidArgument):
        facade.servo(9, True)
    (event,) = facade.events.since(0)[0]
    assert event.text == "servo rejected: axis 9 is outside 0..5"
    assert event.data["outcome"] == "rejected"
    assert facade.events.counts[EventKind.COMMAND, "rejected"] == 1


def test_the_data_of_a_huge_request_drops_no_other_event() -> None:
    events = EventLog(lambda: 0)
    events.add(EventKind.FAULT, "joint1", "the cause")
    data = {"outcome": "rejected", "index": [7] * MAX_DATA_BYTES}
    events.add(EventKind.COMMAND, "homing", "rejected", data=data)
    cause, rejected = events.since(0)[0]
    assert cause.text == "the cause"
    assert rejected.data == {"outcome": "rejected"}
