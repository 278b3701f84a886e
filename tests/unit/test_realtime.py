"""Scheduling is requested, and a refusal is no error."""

from __future__ import annotations

import os
import threading

import pytest

from robotd.cli.commands.run_command import NICENESS, prioritize
from robotd.clock.simulated import PacedClock
from robotd.realtime import request_niceness
from robotd.robot import build_robot


def test_niceness_is_that_of_the_thread_and_of_those_that_it_starts() -> None:
    before, found = os.getpriority(os.PRIO_PROCESS, 0), []

    def note() -> None:
        found.append(os.getpriority(os.PRIO_PROCESS, 0))

    def request() -> None:
        assert request_niceness(before + 3)
        _run(note)

    _run(request)
    assert found == [before + 3]
    assert os.getpriority(os.PRIO_PROCESS, 0) == before


def test_a_refusal_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: int) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "setpriority", refuse)
    assert not request_niceness(-10)


def test_a_served_robot_requests_it_in_real_time_only(monkeypatch: pytest.MonkeyPatch) -> None:
    requested: list[int] = []
    monkeypatch.setattr("robotd.cli.commands.run_command.request_niceness", requested.append)
    prioritize(build_robot("cr3a", "sim", clock=PacedClock()))
    assert not requested
    prioritize(build_robot("cr3a", "sim"))
    assert requested == [NICENESS]


def _run(target: object) -> None:
    thread = threading.Thread(target=target)  # type: ignore[arg-type]
    thread.start()
    thread.join()
