"""The Franka Hand on franky-sim, which serves the maker's protocol of the hand, too."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import franky
import pytest
from tests.plugins.franka.controller import Controller, controller, needs_simulator
from tests.plugins.franka.test_on_controller import arm
from tests.ros.robot_process import wait_until

from robotd import Robot
from robotd.api import ConnectError, NotReady, RobotdError

pytestmark = [needs_simulator, pytest.mark.long]

WIDTH_M = 0.04  # between the fingers of franky-sim at its start: 20 mm each
PATIENT_S = 60.0


@pytest.fixture
def unit() -> Iterator[Controller]:
    with controller() as found:
        yield found


@contextmanager
def hand(folder: Path, unit: Controller) -> Iterator[Robot]:
    with arm(folder, unit.address, variant="hand") as robot:
        assert robot.gripper is not None
        yield robot


def go(robot: Robot, position_m: float) -> tuple[float, bool, bool]:
    state = robot.gripper.move(position_m, lambda: False)
    return state.position_m, state.reached, state.stalled


def test_the_hand_opens_and_closes_and_nothing_moves_before(
    unit: Controller, tmp_path: Path
) -> None:
    with hand(tmp_path, unit) as robot:
        wait_until(lambda: robot.gripper.is_measured and robot.gripper.closed > 0.0, "fingers")
        assert robot.gripper.finger_positions == pytest.approx([WIDTH_M / 2] * 2, abs=1e-3)
        position, reached, _ = go(robot, 0.04)
        assert reached
        assert position == pytest.approx(0.04, abs=2e-3)
        position, reached, _ = go(robot, 0.0)
        assert position == pytest.approx(0.0, abs=2e-3)
        assert robot.gripper.is_commanded_closed
    with hand(tmp_path, unit) as robot:  # it stays closed, and so shown
        assert robot.gripper.is_commanded_closed
        assert go(robot, 0.04)[1]


def test_a_command_on_the_way_replaces_the_one_before(unit: Controller, tmp_path: Path) -> None:
    with hand(tmp_path, unit) as robot:
        assert go(robot, 0.04)[1]
        robot.gripper.command(closed=True)
        wait_until(lambda: robot.gripper.position_m < 0.035, "it closes")
        assert go(robot, 0.04)[1]
        assert robot.gripper.position_m == pytest.approx(0.04, abs=2e-3)


def test_an_arm_whose_hand_does_not_answer_is_not_connected(
    unit: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(franky, "Gripper", fail)
    with pytest.raises(ConnectError, match="the hand does not answer"), hand(tmp_path, unit):
        pass
    monkeypatch.undo()
    with hand(tmp_path, unit) as robot:  # the arm accepts a client: the connection was closed
        assert robot.connection.ready


def fail(address: str) -> None:
    raise franky.NetworkException("Connection refused")


def test_a_lost_hand_is_named_and_takes_no_command(unit: Controller, tmp_path: Path) -> None:
    with hand(tmp_path, unit) as robot:
        unit.kill()
        wait_until(lambda: not robot.connection.ready, "the loss")
        with pytest.raises(NotReady):
            robot.gripper.command(closed=True)


def test_a_hand_without_a_stroke_is_homed_and_a_stop_ends_that(
    unit: Controller, tmp_path: Path
) -> None:
    with hand(tmp_path, unit) as robot:
        unit.command(homed=False)
        driver = robot.gripper._driver.wrapped
        wait_until(lambda: driver._state.max_width == 0.0, "the stroke is lost")
        with pytest.raises(NotReady, match="not homed: robotd gripper home"):
            go(robot, 0.0)
        assert unit.command().hand_commands == []
        robot.gripper.home()
        assert unit.command().hand_commands == ["homing"]
        assert go(robot, 0.04)[1]
        assert go(robot, 0.005)[1]
        with ThreadPoolExecutor() as pool:
            homing = pool.submit(robot.gripper.home)
            wait_until(lambda: robot.gripper.position_m > 0.01, "the fingers open")
            robot.stop()
            with pytest.raises(RobotdError, match="homing was stopped"):
                homing.result()
        wait_until(lambda: unit.command().hand_commands[-1] == "stop", "the stop")
        assert unit.command().width < 0.078
