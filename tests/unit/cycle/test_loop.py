"""The cycle itself: its tasks, its deadlines, and that nothing ends it but ``stop``."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from itertools import pairwise

import pytest
from structlog.testing import capture_logs

from robotd.clock import FakeClock
from robotd.cycle.loop import Cycle
from robotd.cycle.streamer import Streamer
from robotd.descriptor import EngineSettings
from robotd.device.engine import Engine
from robotd.device.image import ProcessImage
from robotd.device.state import EngineState
from robotd.testing.fakes import FakeAxes, FakeDevice

PERIOD_NS = 2_000_000
TIMEOUT_S = 10.0


class Rig:
    """A cycle over fakes. ``run`` steps it; ``thread`` lets it run by the fake clock."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.device, self.driver = FakeDevice(), FakeAxes(2)
        self.engine = Engine(self.device, EngineSettings(), None, "fake")
        self.image = ProcessImage(2)
        self.cycle = Cycle(
            self.driver,
            self.engine,
            self.image,
            Streamer(self.driver, 2, 500.0),
            500.0,
            clock=self.clock,
        )
        self.engine.start()

    def run(self, periods: int) -> None:
        for _ in range(periods):
            self.clock.advance(PERIOD_NS * 1e-9)
            self.driver.image.fresh_ns = self.clock.now_ns()
            self.cycle.step(self.clock.now_ns())


@pytest.fixture
def rig() -> Rig:
    return Rig()


@pytest.mark.parametrize("rate_hz", [500.0, 250.0, 100.0, 60.0, 30.0, 1.0])
def test_a_task_is_called_at_its_rate(rig: Rig, rate_hz: float) -> None:
    times_ns: list[int] = []
    rig.cycle.every(rate_hz, "task", lambda image: times_ns.append(image.stamp_ns))
    rig.run(5000)
    assert len(times_ns) == pytest.approx(10 * rate_hz, abs=1)
    gaps_ns = [later - earlier for earlier, later in pairwise(times_ns)]
    assert all(abs(gap_ns - 1e9 / rate_hz) <= PERIOD_NS for gap_ns in gaps_ns)


def test_a_task_faster_than_the_cycle_is_called_once_a_period(rig: Rig) -> None:
    calls: list[ProcessImage] = []
    rig.cycle.every(5000.0, "task", calls.append)
    rig.run(10)
    assert calls == [rig.image] * 10


def test_a_task_is_not_called_more_often_after_a_pause(rig: Rig) -> None:
    calls: list[ProcessImage] = []
    rig.cycle.every(100.0, "task", calls.append)
    rig.run(5)
    rig.clock.advance(1.0)
    rig.run(50)
    assert len(calls) == 1 + 10


def test_a_task_may_come_while_the_cycle_runs(rig: Rig) -> None:
    calls: list[str] = []

    def first(image: ProcessImage) -> None:
        if not calls:
            rig.cycle.every(500.0, "second", lambda image: calls.append("second"))
        calls.append("first")

    rig.cycle.every(500.0, "first", first)
    rig.run(2)
    assert calls.count("first") == 2
    assert "second" in calls


def test_a_task_that_raises_is_logged_once_and_stops_nobody(rig: Rig) -> None:
    calls: list[ProcessImage] = []

    def broken(image: ProcessImage) -> None:
        raise ZeroDivisionError

    rig.cycle.every(500.0, "broken", broken)
    rig.cycle.every(500.0, "sound", calls.append)
    with capture_logs() as logs:
        rig.run(20)
    assert len(calls) == 20
    assert [(line["event"], line["task"]) for line in logs] == [
        ("a task of the cycle failed", "broken")
    ]


def test_tasks_rest_while_nothing_communicates(rig: Rig) -> None:
    calls: list[ProcessImage] = []
    rig.cycle.every(500.0, "task", calls.append)
    rig.device.current = EngineState.RUNNING
    rig.run(5)
    assert calls == []
    rig.device.current = EngineState.COMMUNICATING
    rig.run(5)
    assert len(calls) == 5


def test_the_image_carries_the_nominal_time(rig: Rig) -> None:
    rig.driver.image.fresh_ns = 5_000_000_000
    rig.cycle.step(5_000_000_000)
    assert rig.image.stamp_ns == 5_000_000_000


def test_the_image_is_forgotten_with_the_communication(rig: Rig) -> None:
    rig.driver.image.servo_on[:] = True
    rig.run(1)
    assert rig.image.servo_on.all()
    assert not rig.image.offline.any()
    rig.device.current = EngineState.RUNNING
    rig.run(1)
    assert not rig.image.servo_on.any()
    assert rig.image.offline.all()
    assert rig.image.stamp_ns == 0


def test_values_that_never_come_are_stale_from_the_start(rig: Rig) -> None:
    rig.driver.image.fresh_ns = 0
    start_ns = rig.clock.now_ns()
    rig.cycle.step(start_ns)
    rig.cycle.step(start_ns + 100_000_000)
    assert rig.engine.ready
    rig.cycle.step(start_ns + 102_000_000)
    assert not rig.engine.ready
    assert rig.engine.state is EngineState.UNKNOWN


def test_a_new_communication_is_not_judged_by_the_last_ones_age(rig: Rig) -> None:
    rig.run(1)
    rig.device.current = EngineState.RUNNING
    rig.run(1)
    rig.clock.advance(60.0)
    rig.driver.image.fresh_ns = 0
    rig.device.current = EngineState.COMMUNICATING
    rig.cycle.step(rig.clock.now_ns())
    assert rig.engine.ready


def test_a_device_that_cannot_tell_its_state_is_logged_once_and_survived(rig: Rig) -> None:
    state = rig.device.state
    rig.device.state = _broken  # type: ignore[method-assign]
    with capture_logs() as logs:
        rig.run(20)
    assert [line["event"] for line in logs] == ["a period of the cycle failed"]
    rig.device.state = state  # type: ignore[method-assign]
    rig.run(1)
    assert rig.engine.ready


def test_a_listener_that_raises_stops_neither_the_others_nor_the_cycle(rig: Rig) -> None:
    heard: list[bool] = []

    def broken(ready: bool) -> None:
        if not ready:
            raise ZeroDivisionError

    rig.engine.on_ready(broken)
    rig.engine.on_ready(heard.append)
    rig.device.current = EngineState.RUNNING
    with capture_logs() as logs:
        rig.run(3)
    assert heard == [True, False]
    assert [line["event"] for line in logs] == ["a listener of the engine failed"]


def test_who_gives_way_waits_for_a_period_that_is_due(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []
    monkeypatch.setattr(time, "sleep", waits.append)
    rig.cycle.give_way()
    assert not waits, "nobody has begun"
    due_ns = rig.cycle.period(rig.clock.now_ns())
    rig.cycle.give_way()
    assert not waits, "a period away"
    rig.clock.advance(PERIOD_NS * 1e-9)
    rig.cycle.give_way()
    assert 0.0 < sum(waits) < 1e-3, "it waits, but not for a cycle that hangs"

    def another_period(_: float) -> None:
        assert rig.cycle.period(due_ns) == due_ns + PERIOD_NS

    monkeypatch.setattr(time, "sleep", another_period)
    rig.cycle.give_way()  # a second period would not be this one's


def _broken() -> EngineState:
    raise OSError("no answer")


@pytest.fixture
def threaded(rig: Rig) -> Iterator[Rig]:
    yield rig
    rig.cycle.stop()


def test_missed_deadlines_are_skipped_and_counted(threaded: Rig) -> None:
    """The fourth period takes 4.5 periods; the fifth begins at the sixth deadline after it."""
    rig, times_ns, ended = threaded, list[int](), threading.Event()

    def task(image: ProcessImage) -> None:
        times_ns.append(image.stamp_ns)
        rig.driver.image.fresh_ns = image.stamp_ns
        if len(times_ns) == 4:
            rig.clock.advance(4.5 * PERIOD_NS * 1e-9)
        if len(times_ns) == 8:
            rig.cycle._stop.set()
            ended.set()

    rig.cycle.every(500.0, "task", task)
    begin_ns = rig.clock.now_ns()
    rig.cycle.start()
    assert ended.wait(TIMEOUT_S)
    rig.cycle.stop()
    periods = [(time_ns - begin_ns) / PERIOD_NS for time_ns in times_ns]
    assert periods == [1, 2, 3, 4, 8, 9, 10, 11]
    report = rig.cycle.stats.report()
    assert (report.cycles, report.missed) == (8, 3)
    assert report.lateness_max_us == pytest.approx(3.5 * PERIOD_NS / 1000)
    assert report.execution_max_us == pytest.approx(4.5 * PERIOD_NS / 1000)
    assert report.lateness_p50_us == 0.0


def test_starting_twice_makes_one_thread_and_stopping_twice_is_fine(threaded: Rig) -> None:
    cycle = threaded.cycle
    cycle.start()
    thread = cycle._thread
    cycle.start()
    assert cycle._thread is thread
    assert sum(each.name == "robotd-cycle" for each in threading.enumerate()) == 1
    cycle.stop()
    cycle.stop()
    assert thread is not None
    assert not thread.is_alive()


def test_stopping_what_never_started_is_fine(rig: Rig) -> None:
    rig.cycle.stop()
