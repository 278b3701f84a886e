"""Scheduling is requested, and a refusal is not an error."""

from __future__ import annotations

import os
import re
import threading
from pathlib import Path

import pytest

from robotd.cli.run_command import TIME_SLICE_S, prioritize
from robotd.clock import MonotonicClock
from robotd.clock.simulated import PacedClock
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.realtime import request_niceness, request_time_slice
from robotd.robot import Robot


def test_niceness_is_that_of_the_thread_and_of_those_that_it_starts() -> None:
    before, found = os.getpriority(os.PRIO_PROCESS, 0), []
    wanted = min(before + 3, 19)  # 19 is the lowest priority

    def note() -> None:
        found.append(os.getpriority(os.PRIO_PROCESS, 0))

    def request() -> None:
        assert request_niceness(wanted)
        _run(note)

    _run(request)
    assert found == [wanted]
    assert os.getpriority(os.PRIO_PROCESS, 0) == before


def test_a_time_slice_is_that_of_the_thread_and_keeps_its_niceness() -> None:
    scheduling = Path("/proc/thread-self/sched")
    if not scheduling.exists() or "se.slice" not in scheduling.read_text(encoding="ascii"):
        pytest.skip("the kernel has no time slices")
    before, found = os.getpriority(os.PRIO_PROCESS, 0), []

    def request() -> None:
        assert request_time_slice(2e-4)
        text = scheduling.read_text(encoding="ascii")
        found.append(re.findall(r"se\.slice +: +(\d+)", text))
        found.append(os.getpriority(os.PRIO_PROCESS, 0))

    _run(request)
    assert found == [["200000"], before]


def test_a_refusal_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: int) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "setpriority", refuse)
    assert not request_niceness(-10)


def test_a_robot_that_asks_for_it_gets_it_in_real_time_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    requested: list[int] = []
    slices: list[float] = []
    command = "robotd.cli.run_command"
    monkeypatch.setattr(f"{command}.request_niceness", requested.append)
    monkeypatch.setattr(f"{command}.request_time_slice", slices.append)
    plain, backend = load_robot_descriptor("cr3a"), load_backend("sim")
    cycle = plain.cycle.model_copy(update={"niceness": -10})
    robot = plain.model_copy(update={"cycle": cycle})
    prioritize(Robot(plain, backend, MonotonicClock()))
    prioritize(Robot(robot, backend, PacedClock()))
    assert not requested
    assert slices == [TIME_SLICE_S]
    prioritize(Robot(robot, backend, MonotonicClock()))
    assert requested == [-10]


def _run(target: object) -> None:
    thread = threading.Thread(target=target)  # type: ignore[arg-type]
    thread.start()
    thread.join()
