"""The application with a cube on a table: does it arrive?"""

from collections.abc import Callable
from pathlib import Path

import pytest
from pick_and_place.arm import Arm
from pick_and_place.carry import LEFT, RIGHT, carry

from robotd_testing.served_robot import RobotUnderTest

CELL = Path(__file__).parents[1] / "scenarios" / "cell.yaml"
START_M, END_M = (0.3684, 0.0966), (0.2236, -0.3085)
FALLS_S = 0.3

Start = Callable[..., RobotUnderTest]


def place_of(robot: RobotUnderTest, name: str) -> list[float]:
    """Return x and y of an object, m."""
    world = robot.robot.world
    assert world is not None
    names = [item.name for item in world.objects]
    return world.poses()[names.index(name)][:2].tolist()


@pytest.fixture
def cell(robotd_robot: Start) -> RobotUnderTest:
    return robotd_robot("cr3a", scenario=CELL, time_scale=2.0)


def test_the_cube_arrives(cell: RobotUnderTest) -> None:
    assert place_of(cell, "cube") == pytest.approx(START_M, abs=2e-3)
    with Arm() as arm:
        carry(arm, LEFT, RIGHT)
    cell.wait_standstill()
    assert place_of(cell, "cube") == pytest.approx(END_M, abs=0.015)
    assert not cell.gripper_closed


def test_a_cube_that_is_not_there_is_not_gripped(cell: RobotUnderTest) -> None:
    assert cell.robot.world is not None
    away = cell.robot.world.poses()[1].copy()
    away[:2] = (0.55, -0.25)
    cell.robot.world.place("cube", away)
    with Arm() as arm:
        carry(arm, LEFT, RIGHT)
    assert place_of(cell, "cube") == pytest.approx([0.55, -0.25], abs=5e-3)
