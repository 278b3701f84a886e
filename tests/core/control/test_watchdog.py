"""Driver that hangs in ``read``: not ready, motion fails, shutdown still works."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from tests.fakes import FakeAxes, FakeDevice

from robotd.clock import Clock, MonotonicClock, wait_until
from robotd.clock.simulated import PacedClock
from robotd.control.loop import watchdog
from robotd.control.loop.control_loop import ControlLoop
from robotd.control.loop.setpoint_mixer import SetpointMixer
from robotd.control.loop.watchdog import Watchdog, place_of
from robotd.descriptor import EngineSettings
from robotd.device.connection import Connection
from robotd.device.process_image import ProcessImage
from robotd.device.state import ConnectionState

LIMIT_S = 0.05


class HangingAxes(FakeAxes):
    """Fresh values until ``hang`` is set; ``go_on`` ends the read that hangs."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(2)
        self.hang, self.go_on = threading.Event(), threading.Event()
        self._clock = clock

    def read(self, image: ProcessImage) -> None:
        if self.hang.is_set():
            self.go_on.wait(20.0)
        super().read(image)
        image.fresh_ns = self._clock.now_ns()


class Harness:
    def __init__(self, clock: Clock) -> None:
        settings = EngineSettings(stale_after_s=LIMIT_S)
        self.axes, self.image = HangingAxes(clock), ProcessImage(2)
        self.connection = Connection(FakeDevice(), settings, None, "fake")
        mixer = SetpointMixer(self.axes, 2, 500.0)
        self.control_loop = ControlLoop(
            self.axes, self.connection, self.image, mixer, self.axes.stop, clock=clock
        )
        self.reported: list[bool] = []
        self.connection.on_ready(self.reported.append)

    def ready(self) -> bool:
        return wait_until(lambda: self.connection.ready, 5.0, MonotonicClock())

    def lost(self) -> bool:
        return wait_until(lambda: not self.connection.ready, 5.0, MonotonicClock())


@pytest.fixture(params=[MonotonicClock, PacedClock])
def harness(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Harness]:
    monkeypatch.setattr("robotd.control.loop.control_loop.STOP_TIMEOUT_S", 0.1)
    monkeypatch.setattr("robotd.control.loop.control_loop.SIMULATED_HANG_TIMEOUT_S", LIMIT_S)
    monkeypatch.setattr(watchdog, "HANG_TIMEOUT_S", LIMIT_S)
    harness = Harness(request.param())
    harness.control_loop.start()
    harness.connection.start()
    assert harness.ready()
    yield harness
    harness.axes.go_on.set()
    harness.control_loop.stop()


def test_a_read_that_hangs_makes_the_engine_not_ready(harness: Harness) -> None:
    harness.axes.hang.set()
    assert harness.lost()
    assert harness.connection.state is ConnectionState.UNKNOWN
    assert harness.reported[-1] is False
    assert "state Unknown): the control loop hangs" in harness.connection.rejection
    assert wait_until(lambda: ("stop", [0, 1]) in harness.axes.calls, 5.0, MonotonicClock())


def test_the_hanging_call_is_found(harness: Harness) -> None:
    harness.axes.hang.set()
    assert harness.lost()
    assert f"{__name__}: HangingAxes.read, line " in place_of(harness.control_loop._thread)


def test_a_control_loop_that_continues_is_ready_again(harness: Harness) -> None:
    harness.axes.hang.set()
    assert harness.lost()
    harness.axes.hang.clear()
    harness.axes.go_on.set()
    assert harness.ready()
    assert harness.connection.fault == ""


def test_the_image_can_be_copied_while_the_driver_hangs(harness: Harness) -> None:
    harness.axes.hang.set()
    assert harness.lost()
    assert harness.image.copy().axes == 2


def test_shutting_down_does_not_wait_for_ever(harness: Harness) -> None:
    harness.axes.hang.set()
    assert harness.lost()
    harness.connection.shutdown()
    harness.control_loop.stop()
    assert harness.connection.state is ConnectionState.SHUTDOWN


def test_a_delay_of_simulated_time_is_no_hang() -> None:
    """Simulated time may stop meanwhile for any time."""
    clock, delayed = PacedClock(), threading.Event()
    harness = Harness(clock)

    def delay(_: ProcessImage) -> None:
        clock.pause()
        delayed.set()
        harness.control_loop.delay(1.0)

    harness.control_loop.every(500.0, "delay", delay, first=True)
    harness.control_loop.start()
    assert delayed.wait(5.0)
    assert wait_until(lambda: harness.control_loop.work_ns() == 0, 5.0, MonotonicClock())
    clock.end()
    harness.control_loop.stop()


def test_a_hang_is_reported_once_for_each_period() -> None:
    age_ns, told = [0], list[str]()
    dog = Watchdog(lambda: age_ns[0], lambda: "acme: read", 2.0, told.append)
    for age_s in (0.0, 1.99, 2.01, 5.0, 0.0, 3.0):
        age_ns[0] = round(age_s * 1e9)
        dog.check()
    assert len(told) == 2
    assert told[0].endswith("longer than 2 s (acme: read)")


def test_a_busy_computer_is_no_hang() -> None:
    told: list[str] = []
    dog = Watchdog(lambda: 400_000_000, str, 0.1, told.append)
    dog.check()
    assert not told
