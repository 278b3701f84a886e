"""A tap: its time, and parts that raise."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest
from structlog.testing import capture_logs
from tests.world_backend import Cubes, cube_backend

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.clock.simulated import PacedClock, SteppedClock
from robotd.descriptor import load_robot_descriptor
from robotd.observation import tap as tap_module
from robotd.observation.frame_ring import Frames
from robotd.observation.io_sampler import FIELDBUS
from robotd.observation.tap import Tap
from robotd.robot import Robot, build_robot

SET_S = 1e6  # as by NTP on a computer without a battery


@pytest.mark.parametrize(("clock", "shift_s"), [(MonotonicClock(), SET_S), (SteppedClock(), 0.0)])
def test_a_clock_that_is_set_counts_in_real_time(
    monkeypatch: pytest.MonkeyPatch, clock: Clock, shift_s: float
) -> None:
    tap = Tap(build_robot("cr3a", "sim", clock=clock), 5.0)
    before_ns = tap.offset_ns
    later_ns = time.time_ns() + round(SET_S * NANOSECONDS)
    monkeypatch.setattr(tap_module, "time", SimpleNamespace(time_ns=lambda: later_ns))
    shift_ns = tap.offset_ns - before_ns
    assert shift_ns / NANOSECONDS == pytest.approx(shift_s, abs=1000.0)


def test_a_part_that_raises_holds_up_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def break_(*_: object) -> FloatArray:
        calls.append("broken")
        raise ValueError("the scene is gone")

    monkeypatch.setattr(Cubes, "poses", break_)
    robot = Robot(load_robot_descriptor("cr3a"), cube_backend(), SteppedClock())
    tap = Tap(robot, 1.0)
    tap.add_reader(lambda: break_() and None)
    tap.add_reader(lambda: calls.append("next"))
    robot.start()
    with capture_logs() as lines:
        for _ in range(2):
            tap.observe()
    robot.shutdown()
    assert calls == ["broken", "broken", "next"] * 2
    assert FIELDBUS in [kind for _, kind, _ in tap.samples.since(0)[0]]
    assert [line["event"] for line in lines] == ["the tap failed"] * 2  # once for each


def test_a_simulation_as_fast_as_possible_loses_no_frame_and_no_event() -> None:
    """A servo that goes off and on within half a second is seen, however busy the computer is."""
    robot = build_robot("cr3a", "sim", clock=PacedClock())
    tap = Tap(robot, 5.0)
    since, lost = tap.frames.since, list[int]()

    def counted(cursor: int, limit: int | None = None) -> tuple[Frames, int, int]:
        found = since(cursor, limit)
        lost.append(found[2])
        return found

    tap.frames.since = counted  # type: ignore[method-assign]
    with tap:
        robot.start()
        clock = robot.clock
        for _ in range(3):
            clock.sleep_until_ns(clock.now_ns() + 20 * NANOSECONDS)
            robot.axes.servo(0, on=False)
            robot.axes.servo(0, on=True)
        clock.sleep_until_ns(clock.now_ns() + 20 * NANOSECONDS)
    robot.shutdown()
    assert sum(lost) == 0
    texts = [event.text for event in tap.events.since(0)[0]]
    assert texts.count("joint1: servo off") == 3
