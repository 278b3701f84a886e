"""A gripper that is a joint: positions, parts that stop it, and what ends its moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from robotd import DescriptorError, InvalidArgument, NotReady, Robot, open_robot
from robotd.api import ProcessImage, load_robot_descriptor
from robotd.api.robots import ServoGripper, SteppedClock
from robotd.descriptor import parse_override

AXIS, SQUEEZE = 5, 0.1


@pytest.fixture
def robot() -> Iterator[Robot]:
    with open_robot("so101", "sim", clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture
def gripper(robot: Robot) -> ServoGripper:
    return robot.servo_grippers["gripper"]


def test_it_moves_to_any_position_and_nothing_else_moves(
    robot: Robot, gripper: ServoGripper
) -> None:
    before = robot.image.position_command.copy()
    for position in (1.7, 0.6, -0.17):
        state = gripper.move(position)
        assert (state.reached, state.stalled, state.at_rest) == (True, False, True)
        assert state.position_m == pytest.approx(position, abs=0.01)
    assert (np.delete(robot.image.position_command, AXIS) == np.delete(before, AXIS)).all()


def test_a_part_stalls_it_and_is_pressed_by_the_squeeze(
    robot: Robot, gripper: ServoGripper
) -> None:
    gripper.move(1.2)
    robot.fault_injector.block(AXIS, True)
    state = gripper.move(-0.17)
    assert (state.reached, state.stalled, state.at_rest) == (False, True, True)
    assert state.position_m == pytest.approx(1.2, abs=0.01)
    robot.step(400)
    assert robot.image.position_command[AXIS] == pytest.approx(state.position_m - SQUEEZE, abs=0.01)
    robot.fault_injector.block(AXIS, False)
    assert gripper.move(1.5).reached


def test_a_slow_move_is_no_stall(robot: Robot, gripper: ServoGripper) -> None:
    robot.set_speed(0.01)
    assert gripper.move(0.1).reached


def test_positions_beyond_its_ends_are_rejected(gripper: ServoGripper) -> None:
    assert gripper.checked(-0.2) == -0.17
    for wrong in (-0.4, 2.0, float("nan")):
        with pytest.raises(InvalidArgument, match=r"gripper: .* is outside -0\.17 to 1\.7"):
            gripper.checked(wrong)
    assert gripper.checked_fingers({"gripper": 0.5}) == 0.5
    with pytest.raises(InvalidArgument, match=r"joint wrist_roll is unknown \(available: gripper"):
        gripper.checked_fingers({"wrist_roll": 0.5})


def test_canceling_stops_the_fingers(robot: Robot, gripper: ServoGripper) -> None:
    start = robot.clock.now_ns()
    state = gripper.move(1.7, lambda: robot.clock.now_ns() - start > 300_000_000)
    assert not state.at_rest
    robot.step(200)
    rest = robot.image.position[AXIS]
    assert 0.0 < rest < 1.0
    robot.step(200)
    assert robot.image.position[AXIS] == rest


def test_a_stop_and_a_stream_keep_it_from_moving(robot: Robot, gripper: ServoGripper) -> None:
    with robot.groups["gripper"].stream(owner="policy"), pytest.raises(NotReady, match="policy"):
        gripper.move(1.0)
    robot.step(20)
    robot.stop("by the test")
    with pytest.raises(NotReady, match="by the test"):
        gripper.move(1.0)


def test_a_servo_that_goes_off_ends_the_move(robot: Robot, gripper: ServoGripper) -> None:
    def trip(image: ProcessImage) -> None:
        if image.position[AXIS] > 0.3:
            robot.fault_injector.trip(AXIS, 0x20)

    robot.control_loop.every(10, "trip", trip)
    with pytest.raises(NotReady, match="gripper: "):
        gripper.move(1.7)


def test_its_joint_and_its_ends_are_checked() -> None:
    for key, value, text in (
        ("joint", "finger", "unknown joint"),
        ("open_position", 2.5, "must be within the limits of gripper"),
        ("closed_position", 1.7, "must differ from open_position"),
    ):
        change = parse_override(f"servo_grippers.gripper.{key}={value}")
        with pytest.raises(DescriptorError, match=text):
            load_robot_descriptor("so101", overrides=[change])
