"""Clocks of simulated time: stepped by who waits, and paced by the cycle's thread."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from robotd.clock import NANOSECONDS, Clock, MonotonicClock, simulated, wait_until
from robotd.clock.simulated import PacedClock, SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import InvalidArgument, Unsupported
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import Backend, load_backend
from robotd.robot import Robot, build_robot, open_robot

PERIOD_NS = 2_000_000
TIMEOUT_S = 10.0


class Periods:
    """Remembers the due times of its periods; one of them may do something."""

    def __init__(self, during: Callable[[int], None] = lambda due_ns: None) -> None:
        self.due_ns: list[int] = []
        self._during = during

    def __call__(self, due_ns: int) -> int:
        self.due_ns.append(due_ns)
        self._during(due_ns)
        return due_ns + PERIOD_NS


def test_sleeping_lives_through_every_period() -> None:
    clock, periods = SteppedClock(), Periods()
    clock.attach(PERIOD_NS, periods)
    start_ns = clock.now_ns()
    clock.sleep_until_ns(start_ns + 10_000_000)
    assert periods.due_ns == [start_ns + n * PERIOD_NS for n in range(1, 6)]
    assert clock.now_ns() == start_ns + 10_000_000


def test_waiting_runs_until_the_condition_holds() -> None:
    clock, periods = SteppedClock(), Periods()
    clock.attach(PERIOD_NS, periods)
    assert wait_until(lambda: len(periods.due_ns) >= 3, 1.0, clock, 0.001)
    assert len(periods.due_ns) == 3
    assert not wait_until(lambda: False, 0.5, clock)


def test_a_period_that_sleeps_is_long() -> None:
    clock = SteppedClock()
    clock.attach(PERIOD_NS, Periods(lambda due_ns: clock.sleep_until_ns(due_ns + 5_000_000)))
    start_ns = clock.now_ns()
    clock.sleep_until_ns(start_ns + PERIOD_NS)
    assert clock.now_ns() == start_ns + PERIOD_NS + 5_000_000


def test_time_passes_without_periods_when_detached_and_never_goes_back() -> None:
    clock, periods = SteppedClock(), Periods()
    clock.attach(PERIOD_NS, periods)
    clock.detach()
    before_ns = clock.now_ns()
    clock.sleep_until_ns(before_ns + 5 * PERIOD_NS)
    clock.sleep_until_ns(before_ns)
    assert clock.now_ns() == before_ns + 5 * PERIOD_NS
    assert periods.due_ns == []


def test_a_scale_slows_time_down() -> None:
    clock = SteppedClock(scale=2.0)
    clock.attach(PERIOD_NS, Periods())
    begin_s = time.monotonic()
    clock.sleep_until_ns(clock.now_ns() + 200_000_000)
    assert time.monotonic() - begin_s > 0.09


@pytest.fixture
def paced() -> Iterator[tuple[PacedClock, Periods]]:
    """A clock that a thread leads, as a cycle does."""
    clock, periods, stop = PacedClock(), Periods(), threading.Event()

    def control_loop() -> None:
        deadline_ns = clock.now_ns() + PERIOD_NS
        while not stop.is_set():
            clock.leader.sleep_until_ns(deadline_ns)
            deadline_ns = periods(deadline_ns)

    thread = threading.Thread(target=control_loop)
    clock.pause()
    thread.start()
    yield clock, periods
    stop.set()
    clock.resume()
    thread.join(TIMEOUT_S)
    clock.end()


Paced = tuple[PacedClock, Periods]


def test_steps_end_with_their_last_period_done(paced: Paced) -> None:
    clock, periods = paced
    start_ns = clock.now_ns()
    assert clock.step(3 * PERIOD_NS, TIMEOUT_S)
    assert periods.due_ns == [start_ns + n * PERIOD_NS for n in (1, 2, 3)]
    assert clock.step(PERIOD_NS, TIMEOUT_S)
    assert clock.now_ns() == start_ns + 4 * PERIOD_NS


def test_a_sleeper_wakes_when_its_time_has_come(paced: Paced) -> None:
    clock, _ = paced
    woken = threading.Event()
    deadline_ns = clock.now_ns() + 5 * PERIOD_NS

    def sleep() -> None:
        clock.sleep_until_ns(deadline_ns)
        woken.set()

    threading.Thread(target=sleep).start()
    clock.step(4 * PERIOD_NS, TIMEOUT_S)
    assert not woken.is_set()
    clock.step(PERIOD_NS, TIMEOUT_S)
    assert woken.wait(TIMEOUT_S)


def test_nobody_waits_on_a_clock_that_has_ended() -> None:
    clock = PacedClock()
    clock.pause()
    clock.end()
    clock.pause()
    clock.sleep_until_ns(clock.now_ns() + 10 * NANOSECONDS)
    assert clock.step(PERIOD_NS, TIMEOUT_S)


def test_time_stands_while_it_is_held_and_nobody_sleeps(paced: Paced) -> None:
    clock, periods = paced
    clock.resume()
    with clock.untimed():
        clock.sleep_until_ns(clock.now_ns() + 3 * PERIOD_NS)  # passes all the same
        count = len(periods.due_ns)
        time.sleep(0.02)
        assert len(periods.due_ns) - count <= 1  # the one that was under way
    clock.sleep_until_ns(clock.now_ns() + 3 * PERIOD_NS)


def test_planning_takes_no_time_however_fast_the_cycle_runs() -> None:
    """The best of some goals: before planning, time flies while the interpreter is elsewhere."""
    taken_ns = [NANOSECONDS]
    with open_robot("cr3a", "sim", clock=PacedClock()) as robot:
        for target in (0.3, 0.0) * 10:
            if min(taken_ns) < 0.1 * NANOSECONDS:
                break
            request = TrajectoryRequest(robot.joint_names, np.array([0.5]), np.full((1, 6), target))
            before_ns = robot.clock.now_ns()
            with robot.follower.follow(request) as execution:
                taken_ns.append(execution.start_ns - before_ns)
                assert execution.wait(TIMEOUT_S)
            assert execution.outcome is Outcome.SUCCEEDED
    assert min(taken_ns) < 0.1 * NANOSECONDS


def moves(clock: Clock) -> tuple[bytes, int]:
    """All that the image held in a second and a half of motion, and the periods that were."""
    seen: list[bytes] = []
    with open_robot("cr3a", "sim", clock=clock) as robot:
        target = np.full((1, 6), 0.4)
        request = TrajectoryRequest(robot.joint_names, np.array([1.0]), target)
        robot.control_loop.every(
            500.0,
            "record",
            lambda image: seen.append(
                image.position.tobytes() + image.velocity.tobytes() + image.torque.tobytes()
            ),
        )
        with robot.follower.follow(request) as execution:
            robot.step(750)
            assert execution.done
    return b"".join(seen[:750]), len(seen)


def test_the_same_commands_give_the_same_motion_at_any_speed() -> None:
    fastest = moves(SteppedClock())
    assert fastest == moves(SteppedClock())
    assert fastest == moves(SteppedClock(scale=8.0))


def test_a_served_robot_steps_like_one_without_a_thread() -> None:
    clock = PacedClock()
    robot = build_robot("cr3a", "sim", clock=clock)
    try:
        robot.start()
        robot.step(1)
        cycles, now_ns = robot.control_loop.stats.cycles, clock.now_ns()
        robot.step(100)
        assert robot.control_loop.stats.cycles == cycles + 100
        assert clock.now_ns() == now_ns + 100 * PERIOD_NS
        assert robot.control_loop.stats.missed == 0
    finally:
        robot.shutdown()


def test_real_time_cannot_be_stepped() -> None:
    with pytest.raises(InvalidArgument, match="only simulated time can be stepped"):
        build_robot("cr3a", "sim").step(1)


def test_a_real_robot_refuses_simulated_time() -> None:
    backend: Backend = load_backend("sim")
    backend.info = replace(backend.info, capabilities=frozenset())
    backend.capabilities = frozenset()
    descriptor = build_robot("cr3a", "sim").descriptor
    for clock in (SteppedClock(), PacedClock()):
        with pytest.raises(Unsupported, match="simulated time: not supported by the sim backend"):
            Robot(descriptor, backend, clock)
    with pytest.raises(Unsupported, match="faults on request"):
        _ = Robot(descriptor, backend, MonotonicClock()).fault_injector


def test_time_stands_while_a_tick_is_registered(
    paced: Paced, monkeypatch: pytest.MonkeyPatch
) -> None:
    class SlowDue(simulated._Due):
        def __init__(self, time_ns: int) -> None:
            super().__init__(time_ns)
            time.sleep(0.05)  # the fast clock runs many periods in that time

    monkeypatch.setattr(simulated, "_Due", SlowDue)
    clock, _ = paced
    clock.resume()
    with clock.ticks(threading.Event(), 5 * PERIOD_NS) as ticks:
        times_ns = [clock.now_ns() for _ in itertools.islice(ticks, 2)]
    assert np.diff(times_ns).tolist() == [5 * PERIOD_NS]


def test_a_slow_thread_misses_no_tick_of_the_fast_clock(paced: Paced) -> None:
    clock, _ = paced
    clock.resume()
    times_ns = []
    with clock.ticks(threading.Event(), 5 * PERIOD_NS) as ticks:
        for _ in ticks:
            times_ns.append(clock.now_ns())
            time.sleep(0.001)
            assert clock.now_ns() == times_ns[-1], "time paused"
            if len(times_ns) == 50:
                break
    assert set(np.diff(times_ns).tolist()) == {5 * PERIOD_NS}
    clock.sleep_until_ns(clock.now_ns() + 3 * PERIOD_NS)  # and passes afterwards


def test_an_event_ends_the_ticks() -> None:
    """Set by the control loop, as the end of a trajectory is."""
    clock, event = PacedClock(), threading.Event()

    def lead() -> None:
        for number in range(1, 101):
            clock.leader.sleep_until_ns(clock.now_ns() + PERIOD_NS)
            if number == 20:
                event.set()
        clock.end()

    with clock.ticks(event, 5 * PERIOD_NS) as ticks:
        threading.Thread(target=lead).start()
        assert len(list(ticks)) in (4, 5)
    assert event.is_set()
