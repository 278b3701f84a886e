"""The backend on franky-sim, which serves the maker's protocol: states, motion, ends of motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import franky
import numpy as np
import pytest
import yaml
from tests.plugins.franka.controller import Controller, controller, needs_simulator
from tests.ros.robot_process import wait_until

from robotd import Robot, open_robot
from robotd.api import ConnectError, InvalidArgument, Operation, Payload, RobotdError
from robotd.api.robots import TrajectoryRequest
from robotd_franka import arm_link
from robotd_franka.code_tables import ERRORS, FIRST_ERROR

pytestmark = [needs_simulator, pytest.mark.long]

STEP = np.array([0.3, 0.2, -0.2, 0.2, 0.3, -0.2, 0.4])
PATIENT_S = 30.0


@contextmanager
def arm(folder: Path, address: str, robot: str = "fr3", variant: str = "") -> Iterator[Robot]:
    """An open robot with servos on, patient with a busy computer."""
    file = folder / "robot.yaml"
    description = {
        "schema": 1,
        "name": "arm",
        "extends": robot,
        "backend": "franka",
        "engine": {"stale_after_s": 5.0, "servo_timeout_s": 30.0},
        "trajectory": {"path_tolerance_rad": 3.0, "goal_time_s": 10.0},
        "backends": {"franka": {"address": address}},
    }
    file.write_text(yaml.safe_dump(description), encoding="utf-8")
    with open_robot(file, variant=variant or None) as found:
        yield found


@pytest.fixture
def unit() -> Iterator[Controller]:
    with controller() as found:
        yield found


@pytest.fixture
def robot(unit: Controller, tmp_path: Path) -> Iterator[Robot]:
    with arm(tmp_path, unit.address) as found:
        yield found


def go(robot: Robot, target: np.ndarray, duration_s: float = 2.0) -> str:
    """Follow a goal to its end; return its message."""
    request = TrajectoryRequest.from_rows(robot.joint_names, [duration_s], [list(target)])
    with robot.follower.follow(request) as execution:
        execution.wait(PATIENT_S)
    return str(execution.message)


def begin(robot: Robot, until: Callable[[], bool]) -> str:
    """Begin a slow goal and wait for ``until`` on the way; return the message of its end."""
    target = robot.image.copy().position + STEP
    request = TrajectoryRequest.from_rows(robot.joint_names, [20.0], [list(target)])
    with robot.follower.follow(request) as execution:
        wait_until(lambda: abs(robot.image.copy().velocity[6]) > 0.01, "motion")
        wait_until(until, "the end of the motion")
        execution.wait(PATIENT_S)
    return str(execution.message)


def test_a_goal_is_reached_by_the_arm_itself(robot: Robot, unit: Controller) -> None:
    start = np.array(unit.command().position)
    assert robot.image.copy().position == pytest.approx(start, abs=0.01)
    assert "goal reached" in go(robot, start + STEP)
    assert unit.command().position == pytest.approx(start + STEP, abs=0.03)
    assert abs(robot.image.copy().torque[1]) > 5.0  # it carries itself


def test_nothing_moves_when_it_is_switched_on_and_off(robot: Robot, unit: Controller) -> None:
    start = np.array(unit.command().position)
    for _ in range(3):
        robot.servos.disable()
        wait_until(lambda: not robot.image.copy().servo_on.any(), "off")
        robot.servos.enable()
        assert unit.command().position == pytest.approx(start, abs=0.005)


def test_a_stop_ends_a_goal_and_the_arm_rests(robot: Robot, unit: Controller) -> None:
    def stopped() -> bool:
        robot.stop()
        return True

    begin(robot, stopped)
    rest = np.array(unit.command().position)
    assert np.abs(robot.image.copy().velocity).max() < 0.05
    robot.reset()
    assert unit.command().position == pytest.approx(rest, abs=0.01)


@pytest.mark.parametrize(
    ("mode", "errors", "said"),
    [
        ("reflex", [25], "communication_constraints_violation"),
        ("reflex", [7], "cartesian_reflex"),
        ("reflex", [], "reflex"),
        ("user_stopped", [], "user stop"),
    ],
)
def test_a_motion_that_the_arm_ends_is_not_resumed(
    mode: str, errors: list[int], said: str, robot: Robot, unit: Controller
) -> None:
    def ended() -> bool:
        unit.command(mode=mode, errors=errors)
        return wait_until(lambda: bool(robot.image.copy().amp_alarm.all()), "the alarm")

    begin(robot, ended)
    wait_until(lambda: said in " ".join(robot.problems), said)
    assert not robot.image.copy().servo_on.any()
    rest, motions = np.array(unit.command().position), unit.command().motions
    if mode == "user_stopped":
        with pytest.raises(RobotdError, match="release the stop button"):
            robot.recover()
        unit.command(mode="idle")
        wait_until(lambda: not robot.image.copy().amp_alarm.any(), "the release")
    assert unit.command().motions == motions  # no servo has gone on by itself
    robot.recover()
    assert unit.command().position == pytest.approx(rest, abs=0.01)
    assert not robot.problems
    assert "goal reached" in go(robot, rest + 0.1)


def test_each_error_has_its_name(robot: Robot, unit: Controller) -> None:
    for number, name in enumerate(ERRORS):
        unit.command(mode="reflex", errors=[number])
        code = FIRST_ERROR + number
        wait_until(lambda: robot.image.copy().controller_alarm == code, name)  # noqa: B023 - at once
        assert name in robot.image.copy().controller_reason


def test_a_guided_arm_is_shown_and_takes_no_command(robot: Robot, unit: Controller) -> None:
    robot.servos.disable()
    unit.command(mode="guiding")
    guiding = int(Operation.GUIDING)
    wait_until(lambda: bool((robot.image.copy().operation == guiding).all()), "guiding")
    with pytest.raises(RobotdError, match="guid"):
        robot.servos.enable()
    unit.command(mode="idle")
    wait_until(lambda: not robot.image.copy().operation.any(), "the end of guiding")
    robot.servos.enable()


def test_a_network_that_is_silent_for_long_is_named(robot: Robot, unit: Controller) -> None:
    def silent() -> bool:
        unit.command(silent_s=PATIENT_S)
        return wait_until(lambda: bool(robot.problems), "the problem")

    begin(robot, silent)
    wait_until(lambda: "connection lost" in " ".join(robot.problems), "the end of the connection")
    unit.command(silent_s=0.0)
    rest = np.array(unit.command().position)
    robot.recover()
    assert unit.command().position == pytest.approx(rest, abs=0.01)


def test_a_path_waits_for_packets_that_are_lost_for_a_moment(
    robot: Robot, unit: Controller
) -> None:
    start = np.array(unit.command().position)
    request = TrajectoryRequest.from_rows(robot.joint_names, [3.0], [list(start + STEP)])
    with robot.follower.follow(request) as execution:
        wait_until(lambda: abs(robot.image.copy().velocity[6]) > 0.01, "motion")
        unit.command(silent_s=0.2)
        execution.wait(PATIENT_S)
    assert "goal reached" in str(execution.message)
    assert unit.command().motions == 1


def test_a_controller_that_restarts_is_opened_again_and_nothing_moves(
    robot: Robot, unit: Controller
) -> None:
    def killed() -> bool:
        unit.kill()
        return wait_until(lambda: bool(robot.problems), "the problem")

    begin(robot, killed)
    with Controller(unit.address) as other:
        rest = np.array(other.command().position)
        wait_until(lambda: "lost" in " ".join(robot.problems), "the end of the connection")
        robot.recover()
        assert other.command().position == pytest.approx(rest, abs=0.01)
        assert "goal reached" in go(robot, rest + 0.1)


def test_an_arm_that_does_not_answer_is_named(tmp_path: Path) -> None:
    absent = arm(tmp_path, "127.255.255.1")
    with pytest.raises(RobotdError, match=r"FCI at 127\.255\.255\.1"):
        absent.__enter__()


def test_a_hand_leads_the_arm_which_is_held_where_it_lets_go(
    robot: Robot, unit: Controller
) -> None:
    start = np.array(unit.command().position)
    unit.command(push=[0, 4.0])
    wait_until(lambda: abs(unit.command().position[0] - start[0]) > 0.003, "the arm gives way")
    assert unit.command().position[0] == pytest.approx(start[0], abs=0.03)  # stiffness holds it
    unit.command(push=[0, 0.0])

    with pytest.raises(RobotdError, match="hand guiding of single joints"):
        robot.axes.begin_guiding([0])
    assert not robot.image.copy().operation.any()
    robot.axes.begin_guiding(range(7))
    unit.command(push=[0, 4.0])
    wait_until(lambda: abs(unit.command().position[0] - start[0]) > 0.1, "the arm is led")
    assert unit.command().position[1:] == pytest.approx(start[1:], abs=0.1)  # it carries itself
    unit.command(push=[0, 0.0])
    robot.stop()
    wait_until(lambda: not robot.image.copy().operation.any(), "the end of guiding")
    robot.reset()
    rest = np.array(unit.command().position)
    assert abs(rest[0] - start[0]) > 0.09
    assert robot.image.copy().servo_on.all()
    assert robot.image.copy().position_command == pytest.approx(rest, abs=0.02)
    assert "goal reached" in go(robot, start)


def test_a_payload_is_set_at_rest_and_the_arm_follows_again(robot: Robot, unit: Controller) -> None:
    before = unit.command()
    robot.payload.set_payload(Payload(1.2, (0.0, 0.01, 0.05)))
    # The control unit takes no load in a motion: there is another one.
    wait_until(lambda: unit.command().motions == before.motions + 1, "the arm follows again")
    assert unit.command().position == pytest.approx(before.position, abs=0.005)
    wait_until(robot.image.servo_on.all, "the servos are shown as on")
    with pytest.raises(InvalidArgument, match=r"3\.5 kg, must be 0 or more and 3 kg at most"):
        robot.payload.set_payload(Payload(3.5))
    assert robot.payload.current() == Payload(1.2, (0.0, 0.01, 0.05))
    robot.servos.disable()
    robot.payload.set_payload(Payload(0.5))
    assert not robot.image.copy().servo_on.any()
    robot.recover()
    assert "goal reached" in go(robot, np.array(before.position) + 0.3 * STEP)


def test_a_second_client_is_told_so_and_connects_when_the_first_has_gone(
    unit: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arm_link, "CONNECT_S", 1.0)
    first = franky.Robot(unit.address, realtime_config=franky.RealtimeConfig.Ignore)
    with (
        pytest.raises(ConnectError, match=r"no answer within 1 s .*another client connected\?"),
        arm(tmp_path, unit.address),
    ):
        pass
    assert first.state.time.to_msec() > 0  # it is not disturbed
    monkeypatch.undo()
    del first
    with arm(tmp_path, unit.address) as robot:
        assert robot.connection.ready
