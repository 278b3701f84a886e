"""Control loop: tasks, deadlines, and survival of every exception."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace

import pytest
from structlog.testing import capture_logs
from tests.fakes import FakeAxes, FakeClock, FakeDevice

from robotd.control.loop.control_loop import ControlLoop, DeviceLoss
from robotd.control.loop.setpoint_mixer import SetpointMixer
from robotd.descriptor import EngineSettings
from robotd.device.connection import Connection
from robotd.device.process_image import ProcessImage
from robotd.device.state import ConnectionState, Underrun
from robotd.errors import OperationError

PERIOD_NS = 2_000_000
TIMEOUT_S = 10.0


class Axes(FakeAxes):
    underrun = Underrun.EXTRAPOLATE


class Harness:
    """Control loop over fakes; ``run`` steps it."""

    def __init__(self, underrun: Underrun = Underrun.EXTRAPOLATE) -> None:
        self.clock = FakeClock()
        self.device, self.driver = FakeDevice(), Axes(2)
        self.driver.underrun = underrun
        self.connection = Connection(self.device, EngineSettings(), None, "fake")
        self.image = ProcessImage(2)
        self.control_loop = ControlLoop(
            self.driver,
            self.connection,
            self.image,
            SetpointMixer(self.driver, 2, 500.0),
            self.driver.stop,
            clock=self.clock,
        )
        self.connection.start()

    def run(self, periods: int) -> None:
        for _ in range(periods):
            self.clock.advance(PERIOD_NS * 1e-9)
            self.driver.image.fresh_ns = self.clock.now_ns()
            self.control_loop.step(self.clock.now_ns())


@pytest.fixture
def harness() -> Harness:
    return Harness()


@pytest.mark.parametrize("rate_hz", [500.0, 250.0, 100.0, 60.0, 30.0, 1.0])
def test_a_task_is_called_at_its_rate(harness: Harness, rate_hz: float) -> None:
    times_ns: list[int] = []
    harness.control_loop.every(rate_hz, "task", lambda image: times_ns.append(image.stamp_ns))
    harness.run(5000)
    assert len(times_ns) == pytest.approx(10 * rate_hz, abs=1)
    gaps_ns = [later - earlier for earlier, later in pairwise(times_ns)]
    assert all(abs(gap_ns - 1e9 / rate_hz) <= PERIOD_NS for gap_ns in gaps_ns)


def test_a_task_faster_than_the_loop_is_called_once_a_period(harness: Harness) -> None:
    calls: list[ProcessImage] = []
    harness.control_loop.every(5000.0, "task", calls.append)
    harness.run(10)
    assert calls == [harness.image] * 10


def test_a_task_is_not_called_more_often_after_a_pause(harness: Harness) -> None:
    calls: list[ProcessImage] = []
    harness.control_loop.every(100.0, "task", calls.append)
    harness.run(5)
    harness.clock.advance(1.0)
    harness.run(50)
    assert len(calls) == 1 + 10


def test_a_task_can_be_added_while_the_loop_runs(harness: Harness) -> None:
    calls: list[str] = []

    def first(image: ProcessImage) -> None:
        if not calls:
            harness.control_loop.every(500.0, "second", lambda image: calls.append("second"))
        calls.append("first")

    harness.control_loop.every(500.0, "first", first)
    harness.run(2)
    assert calls.count("first") == 2
    assert "second" in calls


def test_a_task_that_raises_is_logged_once_and_others_continue(harness: Harness) -> None:
    calls: list[ProcessImage] = []

    def broken(image: ProcessImage) -> None:
        raise ZeroDivisionError

    harness.control_loop.every(500.0, "broken", broken)
    harness.control_loop.every(500.0, "sound", calls.append)
    with capture_logs() as logs:
        harness.run(20)
    assert len(calls) == 20
    assert [(line["event"], line["task"]) for line in logs] == [
        ("a control-loop task failed", "broken")
    ]


def test_tasks_are_not_called_without_communication(harness: Harness) -> None:
    calls: list[ProcessImage] = []
    harness.control_loop.every(500.0, "task", calls.append)
    harness.device.current = ConnectionState.RUNNING
    harness.run(5)
    assert calls == []
    harness.device.current = ConnectionState.COMMUNICATING
    harness.run(5)
    assert len(calls) == 5


def test_the_image_carries_the_nominal_time(harness: Harness) -> None:
    harness.driver.image.fresh_ns = 5_000_000_000
    harness.control_loop.step(5_000_000_000)
    assert harness.image.stamp_ns == 5_000_000_000


def test_the_image_is_cleared_when_communication_ends(harness: Harness) -> None:
    harness.driver.image.servo_on[:] = True
    harness.run(1)
    assert harness.image.servo_on.all()
    assert not harness.image.offline.any()
    harness.device.current = ConnectionState.RUNNING
    harness.run(1)
    assert not harness.image.servo_on.any()
    assert harness.image.offline.all()
    assert harness.image.stamp_ns == 0


def test_values_that_never_arrive_are_stale_from_the_start(harness: Harness) -> None:
    harness.driver.image.fresh_ns = 0
    start_ns = harness.clock.now_ns()
    harness.control_loop.step(start_ns)
    harness.control_loop.step(start_ns + 100_000_000)
    assert harness.connection.ready
    harness.control_loop.step(start_ns + 102_000_000)
    assert not harness.connection.ready
    assert harness.connection.state is ConnectionState.UNKNOWN


def test_staleness_is_measured_from_the_new_communication(harness: Harness) -> None:
    harness.run(1)
    harness.device.current = ConnectionState.RUNNING
    harness.run(1)
    harness.clock.advance(60.0)
    harness.driver.image.fresh_ns = 0
    harness.device.current = ConnectionState.COMMUNICATING
    harness.control_loop.step(harness.clock.now_ns())
    assert harness.connection.ready


def test_an_exception_of_state_is_logged_once_and_survived(harness: Harness) -> None:
    state = harness.device.state
    harness.device.state = _broken  # type: ignore[method-assign]
    with capture_logs() as logs:
        harness.run(20)
    assert [line["event"] for line in logs] == ["a control period failed"]
    harness.device.state = state  # type: ignore[method-assign]
    harness.run(1)
    assert harness.connection.ready


def test_an_exception_stops_the_axes_once(harness: Harness) -> None:
    """Those that got setpoints have none now, and extrapolate."""
    harness.run(1)
    assert not harness.driver.calls
    harness.control_loop._mixer.advance = _broken  # type: ignore[assignment,method-assign]
    harness.run(20)
    assert harness.driver.calls == [("stop", [0, 1])]


def test_a_listener_that_raises_stops_neither_the_others_nor_the_loop(harness: Harness) -> None:
    heard: list[bool] = []

    def broken(ready: bool) -> None:
        if not ready:
            raise ZeroDivisionError

    harness.connection.on_ready(broken)
    harness.connection.on_ready(heard.append)
    harness.device.current = ConnectionState.RUNNING
    with capture_logs() as logs:
        harness.run(3)
    assert heard == [True, False]
    assert [line["event"] for line in logs] == ["a listener of the engine failed", "device lost"]


def test_yield_waits_for_a_period_that_is_due(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []
    monkeypatch.setattr(time, "sleep", waits.append)
    harness.control_loop.yield_to_control_loop()
    assert not waits, "nobody has begun"
    due_ns = harness.control_loop.period(harness.clock.now_ns())
    harness.control_loop.yield_to_control_loop()
    assert not waits, "a period away"
    harness.clock.advance(PERIOD_NS * 1e-9)
    harness.control_loop.yield_to_control_loop()
    assert 0.0 < sum(waits) < 1e-3, "it waits, but not for a loop that hangs"

    def another_period(_: float) -> None:
        assert harness.control_loop.period(due_ns) == due_ns + PERIOD_NS

    monkeypatch.setattr(time, "sleep", another_period)
    harness.control_loop.yield_to_control_loop()  # a second period would not be this one's


def _broken(*_: object) -> ConnectionState:
    raise OSError("no answer")


@pytest.fixture
def threaded(harness: Harness) -> Iterator[Harness]:
    yield harness
    harness.control_loop.stop()


def test_missed_deadlines_are_skipped_and_counted(threaded: Harness) -> None:
    """The fourth period takes 4.5 periods; the fifth begins at the sixth deadline after it."""
    harness, times_ns, ended = threaded, list[int](), threading.Event()

    def task(image: ProcessImage) -> None:
        times_ns.append(image.stamp_ns)
        harness.driver.image.fresh_ns = image.stamp_ns
        if len(times_ns) == 4:
            harness.clock.advance(4.5 * PERIOD_NS * 1e-9)
        if len(times_ns) == 8:
            harness.control_loop._stopping.set()
            ended.set()

    harness.control_loop.every(500.0, "task", task)
    begin_ns = harness.clock.now_ns()
    harness.control_loop.start()
    assert ended.wait(TIMEOUT_S)
    harness.control_loop.stop()
    periods = [(time_ns - begin_ns) / PERIOD_NS for time_ns in times_ns]
    assert periods == [1, 2, 3, 4, 8, 9, 10, 11]
    report = harness.control_loop.stats.report()
    assert (report.cycles, report.missed) == (8, 3)
    assert report.lateness_max_us == pytest.approx(3.5 * PERIOD_NS / 1000)
    assert report.execution_max_us == pytest.approx(4.5 * PERIOD_NS / 1000)
    assert report.lateness_p50_us == 0.0


def test_a_second_start_or_stop_has_no_effect(threaded: Harness) -> None:
    control_loop = threaded.control_loop
    control_loop.start()
    thread = control_loop._thread
    control_loop.start()
    assert control_loop._thread is thread
    assert sum(thread.name == "robotd-control" for thread in threading.enumerate()) == 1
    control_loop.stop()
    control_loop.stop()
    assert thread is not None
    assert not thread.is_alive()


def test_stop_without_start_has_no_effect(harness: Harness) -> None:
    harness.control_loop.stop()


def test_loss_and_return_are_one_line_each_with_the_cause(harness: Harness) -> None:
    harness.run(2)
    harness.device.fault = lambda: "joint2 (node 2): no heartbeat"  # type: ignore[method-assign]
    with capture_logs() as logs:
        harness.device.current = ConnectionState.UNKNOWN
        harness.run(300)
        harness.device.current = ConnectionState.COMMUNICATING
        harness.run(20)
    lost, back = logs
    assert (lost["log_level"], lost["event"]) == ("error", "device lost")
    assert lost["reason"] == "joint2 (node 2): no heartbeat"
    assert (back["log_level"], back["event"]) == ("info", "device is back")
    assert back["after_s"] == pytest.approx(0.6, abs=0.1)


def test_a_device_whose_values_cannot_be_read_is_lost_without_a_traceback(
    harness: Harness,
) -> None:
    harness.run(2)

    def closed(image: ProcessImage) -> None:
        raise OperationError("the feedback port is closed")

    harness.driver.read = closed  # type: ignore[method-assign]
    with capture_logs() as logs:
        harness.run(300)
    [lost] = logs
    assert (lost["event"], lost["reason"]) == ("device lost", "the feedback port is closed")
    assert "the feedback port is closed" in harness.connection.rejection


def test_a_requested_stop_is_not_logged_as_a_loss(harness: Harness) -> None:
    harness.run(2)
    with capture_logs() as logs:
        harness.connection.stop_communication()
        harness.run(20)
        harness.connection.start_communication()
        harness.run(20)
    assert not [line for line in logs if line["event"] in ("device lost", "device is back")]


def test_a_start_in_the_middle_of_a_period_is_not_logged_as_a_loss() -> None:
    connection = SimpleNamespace(ready=False, established=True, fault="")
    loss = DeviceLoss(connection, ProcessImage(1))  # type: ignore[arg-type]
    with capture_logs() as logs:
        loss.report(1)
        connection.ready = True
        loss.report(2)
        assert logs == []
        connection.ready = False
        loss.report(3)
    assert [(line["event"], line["reason"]) for line in logs] == [
        ("device lost", "the device names none")
    ]


def test_a_period_that_would_begin_in_its_second_half_is_skipped() -> None:
    """Drives that hold count two SYNCs close to each other as one."""
    harness = Harness(Underrun.HOLD)
    times_ns: list[int] = []
    harness.control_loop.every(500.0, "task", lambda image: times_ns.append(image.stamp_ns))
    deadline_ns = harness.clock.now_ns()
    harness.clock.advance(1.6 * PERIOD_NS * 1e-9)
    next_ns = harness.control_loop.period(deadline_ns)
    assert next_ns == deadline_ns + 2 * PERIOD_NS
    assert not times_ns
    harness.clock.sleep_until_ns(next_ns)
    harness.driver.image.fresh_ns = next_ns
    assert harness.control_loop.period(next_ns) == next_ns + PERIOD_NS
    assert times_ns == [next_ns]
    report = harness.control_loop.stats.report()
    assert (report.cycles, report.missed) == (1, 2)
    assert report.lateness_max_us == pytest.approx(1.6 * PERIOD_NS / 1000)


def test_a_late_period_of_a_device_that_extrapolates_begins_at_once(harness: Harness) -> None:
    """Its setpoint is due at the deadline after the next: nothing has to wait for it."""
    times_ns: list[int] = []
    harness.control_loop.every(500.0, "task", lambda image: times_ns.append(image.stamp_ns))
    deadline_ns = harness.clock.now_ns()
    harness.clock.advance(1.6 * PERIOD_NS * 1e-9)
    harness.driver.image.fresh_ns = harness.clock.now_ns()
    assert harness.control_loop.period(deadline_ns) == deadline_ns + 3 * PERIOD_NS
    assert times_ns == [deadline_ns + 2 * PERIOD_NS]
    report = harness.control_loop.stats.report()
    assert (report.cycles, report.missed) == (1, 2)


@pytest.mark.parametrize(("asked", "applied"), [(700, 700), (-700, -700), (10**9, 20_000)])
def test_a_driver_shifts_the_next_period_once(harness: Harness, asked: int, applied: int) -> None:
    deadline_ns = harness.clock.now_ns()
    harness.driver.image.fresh_ns = deadline_ns
    harness.driver.image.shift_ns = asked
    next_ns = harness.control_loop.period(deadline_ns)
    assert next_ns == deadline_ns + PERIOD_NS + applied
    harness.driver.image.shift_ns = 0
    harness.clock.sleep_until_ns(next_ns)
    assert harness.control_loop.period(next_ns) == next_ns + PERIOD_NS


def test_deadlines_are_not_made_up_for_without_communication(harness: Harness) -> None:
    harness.device.current = ConnectionState.RUNNING
    deadline_ns = harness.clock.now_ns()
    harness.clock.advance(100.0 * PERIOD_NS * 1e-9)
    assert harness.control_loop.period(deadline_ns) == deadline_ns + 101 * PERIOD_NS


def test_deadlines_are_not_made_up_for_after_an_exception(harness: Harness) -> None:
    harness.device.state = _broken  # type: ignore[method-assign]
    deadline_ns = harness.clock.now_ns()
    harness.clock.advance(100.0 * PERIOD_NS * 1e-9)
    assert harness.control_loop.period(deadline_ns) == deadline_ns + 101 * PERIOD_NS
