"""Prismatic and continuous joints on the simulation: they move, and texts have their unit."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from tests.core.control.harness import ACCELERATION

from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Move
from robotd.errors import InvalidArgument
from robotd.motion import JointTolerance, TrajectoryRejected, TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

NAMES = ("rail", "table")


@pytest.fixture(scope="module")
def robot() -> Iterator[Robot]:
    rail = {"name": "rail", "axis": 0, "type": "prismatic", "lower_m": 0.0, "upper_m": 0.4,
            "velocity_m_s": 1.0, "acceleration_m_s2": 5.0}  # fmt: skip
    table = {"name": "table", "axis": 1, "type": "continuous", "velocity_rad_s": 3.0,
             "acceleration_rad_s2": ACCELERATION}  # fmt: skip
    descriptor = RobotDescriptor.model_validate(
        {"schema": 1, "name": "rig", "joints": [rail, table]}
    )
    robot = Robot(descriptor, load_backend("sim"), SteppedClock())
    try:
        robot.start()
        yield robot
    finally:
        robot.shutdown()


def go(robot: Robot, rail: float, table: float, time_s: float) -> Outcome | None:
    request = TrajectoryRequest.from_rows(NAMES, [time_s], [[rail, table]])
    with robot.follower.follow(request) as execution:
        robot.step(round((time_s + 3.0) * robot.descriptor.cycle.rate_hz))
        return execution.outcome


def test_they_reach_their_goal(robot: Robot) -> None:
    turns = 3.5 * 2.0 * math.pi
    assert go(robot, 0.3, turns, 20.0) is Outcome.SUCCEEDED
    assert robot.image.position[:2] == pytest.approx([0.3, turns], abs=1e-3)


def test_a_path_beyond_the_end_of_a_rail_is_rejected_in_m(robot: Robot) -> None:
    request = TrajectoryRequest.from_rows(NAMES, [5.0], [[0.41, 0.0]])
    with pytest.raises(
        TrajectoryRejected, match=r"rail at 5\.000 s: position 0\.41 m exceeds 0\.4 m"
    ):
        robot.follower.follow(request).__enter__()


def test_a_single_move_beyond_a_limit_is_rejected_in_m(robot: Robot) -> None:
    with pytest.raises(InvalidArgument, match=r"rail.*target 0\.5 m exceeds 0\.4 m"):
        robot.axes.move([Move(0, 0.5, Profile(0.5, 2.0, 2.0))])


def test_the_start_tolerance_of_a_rail_is_in_m(robot: Robot) -> None:
    rail, table = robot.image.position_command[:2]
    request = TrajectoryRequest.from_rows(
        NAMES, [0.0, 2.0], [[rail + 0.005, table + 0.005], [0.2, table]]
    )
    with pytest.raises(TrajectoryRejected, match=r"rail .* start tolerance 0\.002 m"):
        robot.follower.follow(request).__enter__()


def test_tolerances_are_those_of_the_unit(robot: Robot) -> None:
    tolerances = robot.follower.tolerances(goal=[JointTolerance("table", 0.5)])
    assert tolerances.path.position.tolist() == [0.1, 0.2]
    assert tolerances.goal.position.tolist() == [0.001, 0.5]
    assert tolerances.goal.velocity.tolist() == [0.005, 0.01]
    violation = tolerances.check_goal(
        1.0, robot.image.position[:2], robot.image.position[:2] + 0.01, robot.image.velocity[:2]
    )
    assert str(violation).startswith(
        "rail at 1.000 s: position error 0.01 m exceeds goal tolerance"
    )


def test_a_continuous_joint_goes_to_the_number_that_was_asked_for(robot: Robot) -> None:
    """Never the shortest turn: 6.2 rad from 0 are 6.2 rad forward, and 0 from there is back."""
    go(robot, 0.1, 0.0, 12.0)
    for target in (6.2, 0.0):
        positions: list[float] = []
        robot.control_loop.every(
            500.0, "positions", lambda image, seen=positions: seen.append(float(image.position[1]))
        )
        assert go(robot, 0.1, target, 8.0) is Outcome.SUCCEEDED
        assert robot.image.position[1] == pytest.approx(target, abs=1e-3)
        assert min(positions) > -0.01
        assert max(positions) < 6.21


def test_a_path_that_begins_a_turn_away_is_rejected(robot: Robot) -> None:
    rail, table = robot.image.position_command[:2]
    request = TrajectoryRequest.from_rows(
        NAMES, [0.0, 9.0], [[rail, table + 2.0 * math.pi], [rail, table]]
    )
    with pytest.raises(TrajectoryRejected, match=r"table .* start tolerance 0\.01 rad"):
        robot.follower.follow(request).__enter__()
