"""The control loop starts no thread, waits for none, and never for a driver that stops slowly."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from robotd.clock import MonotonicClock, wait_until
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode, Operation
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.realtime import is_control_loop
from robotd.robot import Robot, open_robot
from robotd_sim.axes import SimAxes

WAIT_S = 20.0
AXIS = 2
PROFILE = Profile(0.3, 6.0, 6.0)


@pytest.fixture
def robot() -> Iterator[Robot]:
    with open_robot("cr3a", "sim") as robot:
        yield robot


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of threads that a control loop has started or joined."""
    noted: list[str] = []

    def watched(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def watch(thread: threading.Thread, *arguments: Any) -> Any:
            if is_control_loop():
                noted.append(f"{name} {thread.name}")
            return call(thread, *arguments)

        return watch

    for name in ("start", "join"):
        monkeypatch.setattr(threading.Thread, name, watched(name, getattr(threading.Thread, name)))
    return noted


def until(condition: Callable[[], bool]) -> None:
    assert wait_until(condition, WAIT_S, MonotonicClock())


def idle(robot: Robot, axis: int) -> bool:
    return bool(robot.image.operation[axis] == Operation.IDLE)


def start_move(robot: Robot) -> None:
    robot.axes.move([Move(AXIS, 1.0, PROFILE)])
    until(lambda: float(robot.image.position[AXIS]) > 0.02)


def start_jog(robot: Robot, velocity: float = 0.3) -> None:
    robot.axes.set_command_mode(AXIS, CommandMode.VELOCITY)
    robot.axes.jog([Jog(AXIS, Profile(velocity, 6.0, 6.0))])
    until(lambda: abs(float(robot.image.velocity[AXIS])) > 0.1)


def stop_a_move(robot: Robot) -> None:
    start_move(robot)
    robot.axes.stop_latch.engage("by the test")
    until(lambda: idle(robot, AXIS))
    assert robot.image.position[AXIS] < 0.9


def stop_a_jog(robot: Robot) -> None:
    start_jog(robot)
    robot.axes.stop_latch.engage("by the test")
    until(lambda: idle(robot, AXIS))


def reach_a_soft_limit(robot: Robot) -> None:
    limit = robot.axes.limits[AXIS].upper
    robot.axes.move([Move(AXIS, limit - 0.1, Profile(3.0, 12.0, 12.0))])
    until(lambda: idle(robot, AXIS) and float(robot.image.position[AXIS]) > limit - 0.15)
    start_jog(robot)
    until(lambda: idle(robot, AXIS))
    assert robot.image.position[AXIS] == pytest.approx(limit, abs=0.05)


def end_a_goal(robot: Robot, end: Callable[[Any], None], outcome: Outcome) -> None:
    names = robot.joint_names
    request = TrajectoryRequest.from_rows(names, [4.0], [[0.8] * len(names)])
    with robot.follower.follow(request) as execution:
        until(lambda: float(robot.image.position[AXIS]) > 0.02)
        end(execution)
        assert execution.wait(WAIT_S)
    assert execution.outcome is outcome


def cancel_a_goal(robot: Robot) -> None:
    end_a_goal(robot, lambda execution: execution.cancel(), Outcome.CANCELED)


def stop_a_goal(robot: Robot) -> None:
    end_a_goal(robot, lambda _: robot.axes.stop_latch.engage("by the test"), Outcome.STOPPED)


def trip_a_drive(robot: Robot) -> None:
    end_a_goal(robot, lambda _: robot.fault_injector.trip(AXIS, 0x2310), Outcome.FAULT)


def lose_the_device(robot: Robot) -> None:
    end_a_goal(robot, lambda _: robot.fault_injector.drop_communication(), Outcome.FAULT)


def let_a_stream_fall_silent(robot: Robot) -> None:
    opened = robot.stream(timeout_s=0.1, ends_when_silent=True)
    with opened as stream:
        stream.send_velocity([0.2] * len(robot.joint_names))
        assert stream.wait(WAIT_S)


@pytest.mark.parametrize(
    "stop",
    [
        stop_a_move,
        stop_a_jog,
        reach_a_soft_limit,
        cancel_a_goal,
        stop_a_goal,
        trip_a_drive,
        lose_the_device,
        let_a_stream_fall_silent,
    ],
)
def test_no_kind_of_stop_starts_or_joins_a_thread_in_the_control_loop(
    robot: Robot, threads: list[str], stop: Callable[[Robot], None]
) -> None:
    stop(robot)
    assert threads == []


def test_a_driver_that_stops_slowly_does_not_hold_up_the_control_loop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun, released = threading.Event(), threading.Event()
    plain = SimAxes.stop

    def slow(self: SimAxes, axes: Sequence[int]) -> None:
        if AXIS in axes:
            begun.set()
            released.wait(WAIT_S)
        plain(self, axes)

    monkeypatch.setattr(SimAxes, "stop", slow)
    with open_robot("cr3a", "sim") as robot:
        try:
            start_move(robot)
            robot.axes.stop_latch.engage("by the test")
            assert begun.wait(WAIT_S)
            cycles = robot.control_loop.stats.cycles
            until(lambda: robot.control_loop.stats.cycles > cycles + 100)
            assert not released.is_set()
            assert robot.connection.ready, "no watchdog has seen a hang"
        finally:
            released.set()
        until(lambda: idle(robot, AXIS))
        assert robot.image.position[AXIS] < 0.9
