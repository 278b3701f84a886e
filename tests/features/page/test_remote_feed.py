"""Feed of a robot in another process, from the messages of its topics."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from tests.features.harness import Observed

from robotd_messages.message_encoders import octets_message, string_message
from robotd_page.feed_topics import CHANGES, FIRST, SAMPLES, pack_first
from robotd_page.page_feed import PageFeed
from robotd_page.page_message import Message
from robotd_page.remote_robots import LOST_S, RELOAD_S, RemoteFeed, _Known


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Observed]:
    observed = Observed(tmp_path)
    yield observed
    observed.close()


class Watched:
    """A feed whose robot and clock are in the hands of the test."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.robots = "one"
        self.feed = RemoteFeed("/left", lambda _: self.robots, "/mesh/0/", lambda: self.now_s)

    def put(self, topic: str, data: bytes) -> list[str]:
        self.feed.put(topic, data)
        return self.messages()

    def messages(self) -> list[str]:
        return kinds(self.feed.messages(1, changes=True))


def kinds(messages: Any) -> list[str]:
    return [kind(message) for message in messages]


def kind(message: Message) -> str:
    if isinstance(message, bytes):
        return "samples"
    return message if message in {"one", "two"} else json.loads(message)["type"]


def first_of(arm: Observed, **changes: Any) -> bytes:
    description, samples, state, events = PageFeed(arm.tap, ["a_node"], {}).first(1)
    described = json.loads(description) | changes
    return pack_first([json.dumps(described), samples, state, events])


ALL = ["description", "samples", "state", "events"]


def test_a_viewer_gets_what_the_robot_sends(arm: Observed) -> None:
    watched = Watched()
    assert kinds(watched.feed.first(1)) == ["one"]
    assert watched.put(SAMPLES, octets_message(b"12345678")) == []  # nobody could read it yet
    assert watched.put(FIRST, first_of(arm)) == ALL
    assert watched.put(SAMPLES, octets_message(b"12345678")) == ["samples"]
    event = json.dumps({"type": "events", "events": [{"text": "a fault"}]})
    assert watched.put(CHANGES, string_message(event)) == ["events"]
    objects = json.dumps({"type": "objects", "poses": []})
    assert watched.put(CHANGES, string_message(objects)) == ["objects"]
    later = watched.feed.first(2)  # a second viewer gets all that was sent
    assert kinds(later) == ["one", *ALL, "objects"]
    assert isinstance(later[2], bytes)
    assert later[2].endswith(b"12345678")
    assert json.loads(later[4])["events"][-1]["text"] == "a fault"
    assert watched.put(FIRST, first_of(arm)) == []  # of another page of the same robot
    watched.robots = "two"
    assert watched.messages() == ["two"]


def test_a_silent_robot_is_lost_until_it_answers(arm: Observed) -> None:
    watched = Watched()
    watched.feed.first(1)
    watched.put(FIRST, first_of(arm))
    watched.now_s = LOST_S + 0.1
    assert watched.messages() == ["lost"]
    assert watched.messages() == []
    assert kinds(watched.feed.first(2)) == ["one", *ALL, "lost"]
    assert watched.put(FIRST, octets_message(b"")) == []  # nobody subscribes any more: no answer
    assert watched.put(SAMPLES, octets_message(b"12345678")) == [*ALL, "samples"]


@pytest.mark.parametrize("changes", [{"wall_offset_s": 1.0}, {"pid": 1}, {"computer": "other"}])
def test_a_robot_that_was_started_again_is_shown_from_the_start(
    arm: Observed, changes: dict[str, Any]
) -> None:
    watched = Watched()
    watched.feed.first(1)
    watched.put(FIRST, first_of(arm))
    watched.put(SAMPLES, octets_message(b"12345678"))
    assert watched.put(FIRST, first_of(arm, **changes)) == ALL
    samples = watched.feed.first(2)[2]
    assert isinstance(samples, bytes)
    assert not samples.endswith(b"12345678")


def test_a_page_that_is_loaded_again_misses_nothing(arm: Observed) -> None:
    watched = Watched()
    watched.feed.first(1)
    watched.put(FIRST, first_of(arm))
    watched.feed.release()
    watched.now_s += 0.1
    assert watched.feed.needs_topics
    event = json.dumps({"type": "events", "events": [{"text": "a fault"}]})
    watched.feed.put(CHANGES, string_message(event))
    assert kinds(watched.feed.first(1)) == ["one", *ALL]
    assert watched.messages() == ["events"]
    watched.feed.release()
    watched.now_s += RELOAD_S
    assert not watched.feed.needs_topics


def test_nothing_old_is_shown_when_watching_begins_again(arm: Observed) -> None:
    watched = Watched()
    watched.feed.first(1)
    watched.put(FIRST, first_of(arm))
    watched.feed.release()
    assert not watched.feed.is_watched
    watched.now_s = 100.0
    assert kinds(watched.feed.first(1)) == ["one"]
    assert watched.messages() == []


@pytest.mark.parametrize(
    ("topic", "data"),
    [
        (FIRST, octets_message(b"no separator")),
        (FIRST, octets_message(b"[{}]\0")),
        (FIRST, b"\0\1"),
        (CHANGES, string_message("{")),
        (CHANGES, string_message("[]")),
        (SAMPLES, b""),
    ],
)
def test_a_broken_message_costs_itself_only(arm: Observed, topic: str, data: bytes) -> None:
    watched = Watched()
    watched.feed.first(1)
    watched.put(FIRST, first_of(arm))
    assert watched.put(topic, data) == []
    assert watched.put(SAMPLES, octets_message(b"12345678")) == ["samples"]


@pytest.mark.parametrize("values", [{}, {"kind": "new", "code": "0", "since_ns": "0"}])
def test_problems_of_a_robot_of_another_version_are_not_known(values: dict[str, str]) -> None:
    status = DiagnosticStatus(values=[KeyValue(key=key, value=values[key]) for key in values])
    silent, said = (SimpleNamespace(newest=each) for each in (None, DiagnosticArray()))
    said.newest.status = [status]
    known = _Known(silent, said)  # type: ignore[arg-type]
    assert known.problem_texts() is None
