"""The arm on the stand-in: motion, and the faults that a whole-arm controller can have."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from tests.plugins.dobot.stand_in_backend import StandInFaults

from robotd import open_robot
from robotd.api import ConnectError, NotReady, OperationError, Payload, RobotdError, Unsupported
from robotd.api.robots import (
    Outcome,
    Robot,
    TrajectoryExecution,
    TrajectoryRejected,
    TrajectoryRequest,
)

HERE = Path(__file__).parent
ROBOTS = {"v4": HERE / "robot.yaml", "v3": HERE / "robot_v3.yaml"}
WAIT_S = 30.0


@pytest.fixture(scope="module", params=["v4", pytest.param("v3", marks=pytest.mark.long)])
def generation(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def shared(backend: str, generation: str) -> Iterator[Robot]:
    with open_robot(ROBOTS[generation]) as robot:
        yield robot


@pytest.fixture
def robot(shared: Robot) -> Robot:
    """The robot, ready to move."""
    shared.recover()
    return shared


@pytest.fixture
def faults(robot: Robot) -> StandInFaults:
    assert isinstance(robot.fault_injector, StandInFaults)
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
    wait_until(lambda: not robot.problems, "the last stop is confirmed")
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


def positions(faults: StandInFaults) -> list[float]:
    return [faults.position(axis) for axis in range(6)]


def stand(faults: StandInFaults, seconds: float) -> bool:
    """Return True when no motor moves for that time."""
    before = positions(faults)
    time.sleep(seconds)
    return positions(faults) == pytest.approx(before, abs=1e-6)


def assert_moves(robot: Robot, angle: float) -> None:
    with goal(robot, angle, 1.0) as execution:
        outcome, message = end_of(execution)
    assert outcome is Outcome.SUCCEEDED, message


def test_one_command_switches_all_servos(robot: Robot) -> None:
    robot.axes.servo(3, False)
    wait_until(lambda: not robot.image.servo_on.any(), "all servos are off")
    robot.axes.servo(5, True)
    wait_until(robot.image.servo_on.all, "all servos are on")


def test_a_goal_is_reached(robot: Robot, faults: StandInFaults) -> None:
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


def test_slow_feedback_is_no_following_error(robot: Robot, faults: StandInFaults) -> None:
    """At five times the period, values are up to 40 ms old: 0.03 rad at 0.75 rad/s."""
    faults.send("period", 0.04)
    try:
        with goal(robot, -0.5, 1.0) as execution:
            outcome, message = end_of(execution)
    finally:
        faults.send("period", 0.008)
    assert outcome is Outcome.SUCCEEDED, message
    assert_moves(robot, 0.5)


def test_an_alarm_ends_the_motion_with_code_and_text(robot: Robot, faults: StandInFaults) -> None:
    text = "controller alarm 17 (inverse kinematics without a solution)"
    assert_fault_in_motion(robot, lambda: faults.trip(0, 17), text)
    assert len([problem for problem in robot.problems if "alarm" in problem]) == 1
    robot.recover()
    assert_moves(robot, -0.1)


def test_an_emergency_stop_holds_until_it_is_released(robot: Robot, faults: StandInFaults) -> None:
    assert_fault_in_motion(robot, lambda: faults.send("press", 1), "controller alarm 116")
    with pytest.raises(ConnectError, match="the emergency stop is pressed"):
        robot.recover()
    assert not robot.image.servo_on.any()
    faults.send("press", 0)
    robot.recover()
    assert_moves(robot, -0.1)


def test_feedback_that_stops_ends_the_motion(robot: Robot, faults: StandInFaults) -> None:
    assert_fault_in_motion(robot, lambda: faults.freeze(True), "no feedback for")
    faults.freeze(False)
    wait_until(lambda: robot.connection.ready, "values are fresh again")
    robot.recover()
    assert_moves(robot, -0.1)


def test_a_cut_connection_ends_the_motion_at_the_last_target(
    robot: Robot, faults: StandInFaults
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
    robot: Robot, faults: StandInFaults
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


def test_a_controller_that_dies_in_motion_ends_it(robot: Robot, faults: StandInFaults) -> None:
    assert_fault_in_motion(robot, faults.stop_engine, "connection lost")
    robot.recover()  # the stand-in is started anew
    assert_moves(robot, 0.1)


def test_ctrl_c_does_not_reach_the_controller(faults: StandInFaults) -> None:
    process = faults.device.process
    assert process is not None
    assert os.getpgid(process.pid) != os.getpgid(0)


def assert_shown_as_off(robot: Robot, reason: str) -> None:
    wait_until(lambda: not robot.image.servo_on.any(), "the arm is shown as off")
    assert any(reason in problem for problem in robot.problems), robot.problems


def test_an_arm_that_is_dragged_by_its_button_does_not_return(
    robot: Robot, faults: StandInFaults
) -> None:
    """The target from before would pull it back when the button is released."""
    wait_until(lambda: faults.send("drag", 1) == 0, "drag mode, which an arm at rest takes")
    assert_shown_as_off(robot, "servo off (the arm is in drag mode)")
    for axis in range(6):
        faults.move_by_hand(axis, 0.3)
    left = positions(faults)
    faults.send("drag", 0)
    wait_until(robot.image.servo_on.all, "the arm takes targets again")
    assert stand(faults, 0.3)
    assert positions(faults) == pytest.approx(left, abs=1e-3)
    assert_moves(robot, -0.3)


def test_hand_guiding_is_drag_mode(robot: Robot, faults: StandInFaults) -> None:
    robot.axes.begin_guiding(list(range(6)))
    faults.move_by_hand(1, 0.2)
    with pytest.raises(NotReady, match="guided"):
        robot.axes.servo(0, True)
    robot.axes.stop(list(range(6)))
    wait_until(lambda: not robot.image.operation.any(), "the arm is held")
    assert robot.image.servo_on.all()
    assert_moves(robot, -0.2)


def test_the_controller_has_the_payload_that_was_set(
    robot: Robot, faults: StandInFaults, generation: str
) -> None:
    if generation == "v3":
        with pytest.raises(Unsupported, match="a payload on a controller V3"):
            robot.payload.set_payload(Payload(1.2))
        return
    robot.payload.set_payload(Payload(1.2, (0.0, 0.01, 0.08)))
    assert [faults.send("payload", index) for index in range(4)] == [1.2, 0.0, 10.0, 80.0]
    robot.servos.disable()
    robot.recover()
    assert faults.send("payload", 0) == 1.2  # and not that of the file again
    with pytest.raises(OperationError, match=r"SetPayload: its first parameter is out of range"):
        robot.payload.set_payload(Payload(3.5))
    assert robot.payload.current() == Payload(1.2, (0.0, 0.01, 0.08))
    robot.axes.begin_guiding(list(range(6)))
    with pytest.raises(NotReady, match="in use by hand guiding"):
        robot.payload.set_payload(Payload(0.5))
    robot.axes.stop(list(range(6)))
    wait_until(lambda: not robot.image.operation.any(), "the arm is held")
    assert_moves(robot, 0.1)


@pytest.mark.parametrize(
    ("mode", "reason"),
    [(10, "a program on the controller is paused"), (2, "a brake is open")],
)
def test_another_mode_has_the_arm(
    robot: Robot, faults: StandInFaults, mode: int, reason: str
) -> None:
    faults.send("mode", mode)
    try:
        assert_shown_as_off(robot, reason)
        with pytest.raises(NotReady, match=reason):
            robot.axes.servo(0, True)
    finally:
        faults.send("mode", 0)
    wait_until(robot.image.servo_on.all, "the arm takes targets again")
    assert_moves(robot, 0.1)


def test_a_joint_drives_alarm_has_its_remedy(robot: Robot, faults: StandInFaults) -> None:
    faults.send("trip_drive", 3, 9040)
    text = "controller alarm 309040 (drive of joint 3, 9040: overload)"
    wait_until(lambda: text in str(robot.problems[:1]), "the alarm is shown")
    assert robot.find_problems()[0].code == 309040  # of which the table has a remedy
    robot.recover()
    assert_moves(robot, 0.1)


def test_an_arm_without_power_gets_it(robot: Robot, faults: StandInFaults) -> None:
    faults.send("power", 0)
    assert_shown_as_off(robot, "servo off (the arm has no power)")
    robot.axes.servo(0, True)
    assert_moves(robot, 0.1)


def test_positions_that_no_joint_has_are_a_fault(robot: Robot, faults: StandInFaults) -> None:
    before = robot.image.position.copy()
    faults.send("spoil", 1)
    wait_until(lambda: not robot.connection.ready, "the values are too old")
    assert "positions that no joint has" in robot.connection.reason
    assert robot.image.position.tolist() == pytest.approx(before.tolist(), abs=1e-3)
    faults.send("spoil", 0)
    wait_until(lambda: robot.connection.ready, "values are fresh again")


def test_a_controller_in_another_mode_is_asked_for_control(
    robot: Robot, faults: StandInFaults, generation: str
) -> None:
    """An arm that is on keeps its mode, as the guide has it."""
    if generation == "v3":
        pytest.skip("V3 has one mode")
    robot.connection.stop_communication()
    faults.send("tcp", 0)
    robot.recover()
    assert_moves(robot, 0.1)
    faults.send("tcp", 0)
    robot.connection.stop_communication()
    with pytest.raises(RobotdError, match="not in TCP mode"):
        robot.recover()
    faults.send("tcp", 1)


def test_the_generation_is_found(robot: Robot, generation: str) -> None:
    expected = f"CR3A on a controller {generation.upper()} at 127.0.0.1: "
    assert robot.connection.scan_network().startswith(expected)


def test_targets_need_no_answers(robot: Robot, faults: StandInFaults, generation: str) -> None:
    """The guide of V3 promises none, and its clients wait for them."""
    if generation == "v4":
        pytest.skip("V4 answers each")
    for answers in (0, 1):
        faults.send("answers", answers)
        faults.drop_communication()
        wait_until(lambda: not robot.connection.ready, "the connection is lost")
        robot.recover()
        assert_moves(robot, 0.1)


def test_outputs_are_terminals(robot: Robot, faults: StandInFaults) -> None:
    robot.io.set_output_bit(0, 2, True)
    assert faults.output_bit(0, 2)
    wait_until(lambda: robot.io.output_bit(0, 2), "the output is shown")
    robot.io.set_output_bit(0, 2, False)
