"""A gripper on an output bit: moves, travel time, and the sensor that shows a part."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from tests.unit.control.harness import Harness, arm

from robotd.errors import InvalidArgument

GRIPPER = {
    "output_byte": 0,
    "output_bit": 0,
    "joints": ["left", "right"],
    "open_m": 0.0,
    "closed_m": 0.04,
    "travel_time_s": 0.2,
    "part_sensor": {"input_byte": 1, "input_bit": 3},
}


@pytest.fixture
def robot() -> Iterator[Harness]:
    harness = Harness(arm(gripper=GRIPPER)).up()
    yield harness
    harness.robot.shutdown()


def test_it_closes_within_its_travel_time_and_tells_what_it_knows(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    began_s = robot.now_s
    state = gripper.move(0.04, lambda: False)
    assert (state.position_m, state.reached, state.stalled, state.at_rest) == (
        0.04, True, False, True
    )  # fmt: skip
    assert robot.now_s - began_s == pytest.approx(0.25, abs=0.01)
    assert gripper.is_commanded_closed


def test_a_part_stalls_it(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    robot.faults.set_input_bit(1, 3, True)
    state = gripper.move(0.04, lambda: False)
    assert (state.reached, state.stalled, state.at_rest) == (False, True, True)


def test_a_canceled_move_is_not_at_rest(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    begun_s = robot.now_s
    state = gripper.move(0.04, lambda: robot.now_s > begun_s + 0.1)
    assert not state.at_rest
    assert state.position_m == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize("position", [0.1, -0.01, math.nan])
def test_a_position_outside_the_stroke_is_rejected(robot: Harness, position: float) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    with pytest.raises(InvalidArgument, match=r"is outside 0\.0 to 0\.04 m"):
        gripper.checked(position)
