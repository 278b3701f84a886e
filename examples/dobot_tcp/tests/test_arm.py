"""The arm on the stand-in: motion, and the faults that a whole-arm controller can have."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from dobot_tcp_fake.backend import FakeFaultInjector

from robotd import open_robot
from robotd.api import ConnectError
from robotd.api.robots import (
    Outcome,
    Robot,
    TrajectoryExecution,
    TrajectoryRejected,
    TrajectoryRequest,
)

ROBOT = Path(__file__).parent / "robot.yaml"
WAIT_S = 30.0


@pytest.fixture(scope="module")
def shared() -> Iterator[Robot]:
    with open_robot(ROBOT) as robot:
        yield robot


@pytest.fixture
def robot(shared: Robot) -> Robot:
    """The robot, ready to move."""
    shared.recover()
    return shared


@pytest.fixture
def faults(robot: Robot) -> FakeFaultInjector:
    assert isinstance(robot.fault_injector, FakeFaultInjector)
    return robot.fault_injector


def wait_until(condition: Callable[[], object], what: str) -> None:
    deadline = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline, f"not in time: {what}"
        time.sleep(0.01)


@contextmanager
def goal(robot: Robot, angle: float, seconds: float) -> Iterator[TrajectoryExecution]:
    """Move every joint by ``angle``, rad, away from where it is, once all stand."""
    wait_until(lambda: not robot.image.operation.any(), "the last stop has ended")
    targets = robot.image.copy().position_command + angle
    request = TrajectoryRequest.from_rows(robot.joint_names, [seconds], [targets.tolist()])
    with robot.follower.follow(request) as execution:
        yield execution


def end_of(execution: TrajectoryExecution) -> tuple[Outcome | None, str]:
    assert execution.wait(WAIT_S)
    return execution.outcome, execution.message


def assert_fault_in_motion(robot: Robot, cause: Callable[[], object], reason: str) -> None:
    """Raise a fault in motion; it ends the goal, with its reason, and is cleared by ``recover``."""
    with goal(robot, 1.0, 4.0) as execution:
        start = robot.image.position.copy()
        wait_until(lambda: np.abs(robot.image.position - start).min() > 0.1, "the arm moves")
        cause()
        outcome, message = end_of(execution)
    assert outcome is Outcome.FAULT
    assert reason in message
    assert any(reason in problem for problem in robot.problems), robot.problems


def positions(faults: FakeFaultInjector) -> list[float]:
    return [faults.position(axis) for axis in range(6)]


def stand(faults: FakeFaultInjector, seconds: float) -> bool:
    """Return True when no motor moves for that time."""
    before = positions(faults)
    time.sleep(seconds)
    return positions(faults) == before


def assert_moves(robot: Robot, angle: float) -> None:
    with goal(robot, angle, 1.0) as execution:
        outcome, message = end_of(execution)
    assert outcome is Outcome.SUCCEEDED, message


def test_one_command_switches_all_servos(robot: Robot) -> None:
    robot.axes.servo(3, False)
    wait_until(lambda: not robot.image.servo_on.any(), "all servos are off")
    robot.axes.servo(5, True)
    wait_until(robot.image.servo_on.all, "all servos are on")


def test_a_goal_is_reached(robot: Robot, faults: FakeFaultInjector) -> None:
    assert_moves(robot, 0.4)
    assert [faults.position(axis) for axis in range(6)] == pytest.approx(
        robot.image.copy().position_command.tolist(), abs=1e-3
    )
    assert_moves(robot, -0.4)


def test_a_goal_beyond_the_controllers_range_is_rejected(robot: Robot) -> None:
    """joint3 may go to -2.86 rad by the file, and to -155° by the controller."""
    request = TrajectoryRequest.from_rows(robot.joint_names, [5.0], [[0, 0, -2.8, 0, 0, 0]])
    with pytest.raises(TrajectoryRejected, match=r"joint3 at .* -2.8 rad is below -2.705"):
        robot.follower.follow(request).__enter__()


def test_slow_feedback_is_no_following_error(robot: Robot, faults: FakeFaultInjector) -> None:
    """At five times the period, values are up to 40 ms old: 0.03 rad at 0.75 rad/s."""
    faults.send("period", 0.04)
    try:
        with goal(robot, -0.5, 1.0) as execution:
            outcome, message = end_of(execution)
    finally:
        faults.send("period", 0.008)
    assert outcome is Outcome.SUCCEEDED, message
    assert_moves(robot, 0.5)


def test_an_alarm_ends_the_motion_with_code_and_text(
    robot: Robot, faults: FakeFaultInjector
) -> None:
    text = "controller alarm 17 (inverse kinematics without a solution)"
    assert_fault_in_motion(robot, lambda: faults.trip(0, 17), text)
    assert len([problem for problem in robot.problems if "alarm" in problem]) == 1
    robot.recover()
    assert_moves(robot, -0.1)


def test_an_emergency_stop_holds_until_it_is_released(
    robot: Robot, faults: FakeFaultInjector
) -> None:
    assert_fault_in_motion(robot, lambda: faults.send("press", 1), "controller alarm 900")
    with pytest.raises(ConnectError, match="the emergency stop is pressed"):
        robot.recover()
    assert not robot.image.servo_on.any()
    faults.send("press", 0)
    robot.recover()
    assert_moves(robot, -0.1)


def test_feedback_that_stops_ends_the_motion(robot: Robot, faults: FakeFaultInjector) -> None:
    assert_fault_in_motion(robot, lambda: faults.freeze(True), "no feedback for")
    faults.freeze(False)
    wait_until(lambda: robot.connection.ready, "values are fresh again")
    robot.recover()
    assert_moves(robot, -0.1)


def test_a_cut_connection_ends_the_motion_at_the_last_target(
    robot: Robot, faults: FakeFaultInjector
) -> None:
    assert_fault_in_motion(robot, faults.drop_communication, "connection lost")
    lost = positions(faults)
    wait_until(lambda: stand(faults, 0.2), "the motors reach the last target")
    at_rest = positions(faults)
    assert at_rest == pytest.approx(lost, abs=0.01)
    robot.recover()
    assert robot.image.copy().position.tolist() == pytest.approx(at_rest, abs=1e-3)
    assert_moves(robot, -0.1)


def test_targets_that_the_controller_has_not_read_are_not_executed_late(
    robot: Robot, faults: FakeFaultInjector
) -> None:
    """It reads none for a second: the connection is reset, and with it what waits is gone."""
    assert_fault_in_motion(robot, lambda: faults.send("busy", 1), "connection lost (targets cannot")
    wait_until(lambda: stand(faults, 0.2), "the motors reach the last target that was read")
    at_rest = positions(faults)
    faults.send("busy", 0)
    assert stand(faults, 1.0)
    assert positions(faults) == at_rest
    robot.recover()
    assert_moves(robot, -0.1)


def test_a_controller_that_dies_in_motion_ends_it(robot: Robot, faults: FakeFaultInjector) -> None:
    assert_fault_in_motion(robot, faults.stop_engine, "connection lost")
    robot.recover()  # the stand-in is started anew
    assert_moves(robot, 0.1)


def test_ctrl_c_does_not_reach_the_controller(faults: FakeFaultInjector) -> None:
    process = faults.device.process
    assert process is not None
    assert os.getpgid(process.pid) != os.getpgid(0)


def test_outputs_are_terminals(robot: Robot, faults: FakeFaultInjector) -> None:
    robot.io.set_output_bit(0, 2, True)
    assert faults.output_bit(0, 2)
    wait_until(lambda: robot.io.output_bit(0, 2), "the output is shown")
    robot.io.set_output_bit(0, 2, False)
