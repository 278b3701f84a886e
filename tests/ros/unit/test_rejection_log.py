"""A stream of bad commands leaves one line of log."""

from __future__ import annotations

import itertools
import time
from types import SimpleNamespace
from typing import Any

import pytest
from structlog.testing import capture_logs

from robotd_ros.nodes.command_subscription import (
    MAX_AXES,
    MAX_KINDS,
    MAX_KNOWN,
    PAUSE_S,
    RejectionLog,
)

HOST: Any = SimpleNamespace(on_rejection=lambda topic, axes, reason: None)


def test_what_is_logged_is_reported_with_its_axes() -> None:
    reported: list[tuple[str, tuple[int, ...], str]] = []
    host: Any = SimpleNamespace(on_rejection=lambda *rejection: reported.append(rejection))
    log = RejectionLog(host)
    for _ in range(2):
        log.rejected("position", [1], "servo is off")
    assert reported == [("position", (1,), "servo is off")]


def test_the_same_refusal_is_logged_once_whatever_its_numbers() -> None:
    log = RejectionLog(HOST)
    with capture_logs() as lines:
        for target in (3.2, 3.25, -4e-3):
            log.rejected("position", [1], f"joint2: target {target} rad exceeds 3.14 rad")
    assert len(lines) == 1
    assert lines[0]["reason"] == "joint2: target 3.2 rad exceeds 3.14 rad"


def test_another_reason_axis_or_topic_is_news() -> None:
    log = RejectionLog(HOST)
    with capture_logs() as lines:
        log.rejected("position", [1], "servo is off")
        log.rejected("position", [1], "engine is not ready")
        log.rejected("position", [2], "servo is off")
        log.rejected("velocity", [1], "servo is off")
        log.rejected("position", [1], "servo is off")
    assert len(lines) == 4


def test_after_an_accepted_command_the_refusal_is_news_again() -> None:
    log = RejectionLog(HOST)
    with capture_logs() as lines:
        log.rejected("position", [1], "servo is off")
        log.accepted("position", [2])
        log.rejected("position", [1], "servo is off")
        log.accepted("position", [1])
        log.rejected("position", [1], "servo is off")
    assert len(lines) == 2


def test_a_flood_of_ever_other_axes_is_cut_off_until_a_command_is_accepted() -> None:
    log = RejectionLog(HOST)
    with capture_logs() as lines:
        for axis in range(10 * MAX_KNOWN):
            log.rejected("velocity", [axis] * (2 * MAX_AXES), "an axis is outside 0..5")
    assert len(lines) == MAX_KNOWN + 1
    assert all(len(line.get("axes", ())) <= MAX_AXES for line in lines)
    with capture_logs() as lines:
        log.accepted("velocity", [0])
        log.rejected("velocity", [9999], "an axis is outside 0..5")
    assert len(lines) == 1


def test_a_flood_of_ever_other_texts_is_cut_off_until_a_command_is_accepted() -> None:
    log = RejectionLog(HOST)
    names = ["".join(letters) for letters in itertools.product("abcdef", repeat=4)]
    with capture_logs() as lines:
        for name in names:
            log.rejected("jog", [], f"unknown joint {name!r}")
    assert len(lines) == MAX_KINDS + 1
    with capture_logs() as lines:
        log.accepted("jog", [])
        log.rejected("jog", [], "unknown joint 'x'")
    assert len(lines) == 1


def test_after_a_pause_the_refusal_is_news_again(monkeypatch: pytest.MonkeyPatch) -> None:
    log, times_s = RejectionLog(HOST), iter((10.0, 10.0 + PAUSE_S, 10.1 + 2 * PAUSE_S))
    monkeypatch.setattr(time, "monotonic", lambda: next(times_s))
    with capture_logs() as lines:
        for _ in range(2):
            log.rejected("jog", [1], "servo is off")
        assert len(lines) == 1
        log.rejected("jog", [1], "servo is off")
    assert len(lines) == 2
