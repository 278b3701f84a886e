"""Rejected requests leave one line of log a second for each client, however large they are."""

from __future__ import annotations

import ctypes
import time
from typing import Any

import pytest
from structlog.testing import capture_logs

from robotd.errors import InvalidArgument
from robotd.log import MAX_REASON_CHARACTERS, shortened
from robotd_ros.middleware.release_gil import RequestId
from robotd_ros.request_log import MAX_KNOWN, PERIOD_S, RequestLog

REJECTED = InvalidArgument("axis 7 is outside 0..5")


def request_of(client: int) -> RequestId:
    guid = (ctypes.c_uint8 * 16)(*client.to_bytes(12, "big"))
    return RequestId(guid, 1)


@pytest.fixture
def now_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    times = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: times[0])
    return times


def lines_of(log: RequestLog, *rejections: tuple[Any, Exception]) -> list[Any]:
    with capture_logs() as lines:
        for header, error in rejections:
            log.rejected(header, "service rejected", error, service="homing")
    return lines


def test_a_client_gets_one_line_a_second(now_s: list[float]) -> None:
    log = RequestLog()
    first = lines_of(log, *[(request_of(1), REJECTED)] * 5)
    assert [line["reason"] for line in first] == [str(REJECTED)]
    now_s[0] += PERIOD_S
    (later,) = lines_of(log, (request_of(1), REJECTED))
    assert later["hidden"] == 4


def test_clients_have_lines_of_their_own(now_s: list[float]) -> None:
    known, unknown = ((request_of(1), REJECTED), (request_of(2), REJECTED)), (None, REJECTED)
    assert len(lines_of(RequestLog(), *known, unknown, *known, unknown)) == 3


def test_a_fault_of_a_handler_is_not_hidden_by_a_rejection(now_s: list[float]) -> None:
    fault = KeyError("joint9")
    lines = lines_of(RequestLog(), (None, REJECTED), (None, fault), (None, fault))
    assert [line.get("exc_info") for line in lines] == [None, fault]


def test_clients_do_not_fill_the_memory(now_s: list[float]) -> None:
    log = RequestLog()
    lines_of(log, *((request_of(number), REJECTED) for number in range(10 * MAX_KNOWN)))
    assert len(log._known) <= MAX_KNOWN


def test_a_long_reason_is_cut_in_the_middle(now_s: list[float]) -> None:
    error = InvalidArgument(f"unknown joint '{'x' * 200_000}' (available: joint1)")
    (line,) = lines_of(RequestLog(), (None, error))
    assert line["reason"] == shortened(str(error))
    assert len(line["reason"]) < MAX_REASON_CHARACTERS + 100
    assert line["reason"].startswith("unknown joint 'xxx")
    assert line["reason"].endswith("(available: joint1)")
    assert "characters left out" in line["reason"]
