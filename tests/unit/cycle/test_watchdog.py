"""A driver that hangs in ``read``: the robot is not ready, motion has failed, it can be ended."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from robotd.clock import Clock, MonotonicClock, wait_until
from robotd.cycle import watchdog
from robotd.cycle.loop import Cycle
from robotd.cycle.streamer import Streamer
from robotd.cycle.watchdog import Watchdog, place_of
from robotd.descriptor import EngineSettings
from robotd.device.engine import Engine
from robotd.device.image import ProcessImage
from robotd.device.state import EngineState
from robotd.simulated_clock import PacedClock
from robotd.testing.fakes import FakeAxes, FakeDevice

LIMIT_S = 0.05


class HangingAxes(FakeAxes):
    """Live values, until ``hang`` is set; ``go_on`` ends the read that hangs."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(2)
        self.hang, self.go_on = threading.Event(), threading.Event()
        self._clock = clock

    def read(self, image: ProcessImage) -> None:
        if self.hang.is_set():
            self.go_on.wait(20.0)
        super().read(image)
        image.fresh_ns = self._clock.now_ns()


class Bench:
    def __init__(self, clock: Clock) -> None:
        settings = EngineSettings(stale_after_s=LIMIT_S)
        self.axes, self.image = HangingAxes(clock), ProcessImage(2)
        self.engine = Engine(FakeDevice(), settings, None, "fake")
        streamer = Streamer(self.axes, 2, 500.0)
        self.cycle = Cycle(self.axes, self.engine, self.image, streamer, 500.0, clock=clock)
        self.heard: list[bool] = []
        self.engine.on_ready(self.heard.append)

    def ready(self) -> bool:
        return wait_until(lambda: self.engine.ready, 5.0, MonotonicClock())

    def lost(self) -> bool:
        return wait_until(lambda: not self.engine.ready, 5.0, MonotonicClock())


@pytest.fixture(params=[MonotonicClock, PacedClock])
def bench(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr("robotd.cycle.loop.STOP_S", 0.1)
    monkeypatch.setattr("robotd.cycle.loop.SIMULATED_HANG_S", LIMIT_S)
    monkeypatch.setattr(watchdog, "HANG_S", LIMIT_S)
    bench = Bench(request.param())
    bench.cycle.start()
    bench.engine.start()
    assert bench.ready()
    yield bench
    bench.axes.go_on.set()
    bench.cycle.stop()


def test_a_read_that_hangs_makes_the_engine_not_ready(bench: Bench) -> None:
    bench.axes.hang.set()
    assert bench.lost()
    assert bench.engine.state is EngineState.UNKNOWN
    assert bench.heard[-1] is False
    assert "state Unknown): the cycle hangs" in bench.engine.refusal
    assert wait_until(lambda: ("stop", [0, 1]) in bench.axes.calls, 5.0, MonotonicClock())


def test_the_place_where_it_hangs_is_found(bench: Bench) -> None:
    bench.axes.hang.set()
    assert bench.lost()
    assert f"{__name__}: HangingAxes.read, line " in place_of(bench.cycle._thread)


def test_a_cycle_that_goes_on_is_ready_again(bench: Bench) -> None:
    bench.axes.hang.set()
    assert bench.lost()
    bench.axes.hang.clear()
    bench.axes.go_on.set()
    assert bench.ready()
    assert bench.engine.fault == ""


def test_the_image_can_be_copied_while_the_driver_hangs(bench: Bench) -> None:
    bench.axes.hang.set()
    assert bench.lost()
    assert bench.image.copy().axes == 2


def test_shutting_down_does_not_wait_for_ever(bench: Bench) -> None:
    bench.axes.hang.set()
    assert bench.lost()
    bench.engine.shutdown()
    bench.cycle.stop()
    assert bench.engine.state is EngineState.SHUTDOWN


def test_a_delay_of_simulated_time_is_no_hang() -> None:
    """Time may stand meanwhile for as long as it likes."""
    clock, delayed = PacedClock(), threading.Event()
    bench = Bench(clock)

    def delay(_: ProcessImage) -> None:
        clock.pause()
        delayed.set()
        bench.cycle.delay(1.0)

    bench.cycle.every(500.0, "delay", delay, first=True)
    bench.cycle.start()
    assert delayed.wait(5.0)
    assert wait_until(lambda: bench.cycle._age_ns() == 0, 5.0, MonotonicClock())
    clock.end()
    bench.cycle.stop()


def test_a_hang_is_told_once_for_each_period() -> None:
    age_ns, told = [0], list[str]()
    dog = Watchdog(lambda: age_ns[0], lambda: "acme: read", 2.0, told.append)
    for age_s in (0.0, 1.99, 2.01, 5.0, 0.0, 3.0):
        age_ns[0] = round(age_s * 1e9)
        dog.look()
    assert len(told) == 2
    assert told[0].endswith("longer than 2 s (acme: read)")


def test_a_busy_computer_is_no_hang() -> None:
    told: list[str] = []
    dog = Watchdog(lambda: 400_000_000, str, 0.1, told.append)
    dog.look()
    assert not told
