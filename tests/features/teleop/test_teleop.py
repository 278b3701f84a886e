"""A follower begins without a jump, follows within its limits, and stops with its leader."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from robotd import InvalidArgument, NotReady, Robot, open_robot
from robotd.api import load_robot_descriptor
from robotd.api.robots import SteppedClock
from robotd_teleop.alignment import Alignment
from robotd_teleop.joint_map import JointMapping, joint_map, parse_mapping
from robotd_teleop.leader_follower import LeaderFollower

PERIOD_S = 1.0 / 50.0
SPEED = 0.3


@pytest.fixture
def leader() -> Iterator[Robot]:
    with open_robot("so101_leader", "sim", enable=False, clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture
def robot() -> Iterator[Robot]:
    with open_robot("so101", "sim", clock=SteppedClock()) as robot:
        yield robot


def run(follower: LeaderFollower, leader: Robot, robot: Robot, seconds: float) -> np.ndarray:
    """Commands of the robot in each step, (k, joints)."""
    rows = []
    for _ in range(round(seconds / PERIOD_S)):
        follower.step(PERIOD_S)
        for arm in (leader, robot):
            arm.step(round(PERIOD_S * arm.descriptor.cycle.rate_hz))
        rows.append(robot.image.position_command.copy())
    return np.array(rows)


def follow(leader: Robot, robot: Robot) -> LeaderFollower:
    return LeaderFollower(leader, robot, joint_map(leader.descriptor, robot.descriptor, ()), SPEED)


def test_the_robot_approaches_a_leader_that_is_elsewhere_slowly(
    leader: Robot, robot: Robot
) -> None:
    for axis, delta in enumerate((0.6, -0.4, 0.0, 0.0, 0.2, 0.3)):
        leader.fault_injector.move_by_hand(axis, delta)
    leader.step(10)
    with follow(leader, robot) as follower:
        commands = run(follower, leader, robot, 3.0)
        speeds = np.abs(np.diff(commands, axis=0)) / PERIOD_S
        assert speeds.max() <= 1.2 * SPEED
        assert follower.alignment.aligned
        leader.fault_injector.move_by_hand(0, 0.1)
        commands = run(follower, leader, robot, 1.0)
    assert commands[-1] == pytest.approx(leader.image.position, abs=0.01)


def test_a_leader_that_stops_answering_stops_the_robot(leader: Robot, robot: Robot) -> None:
    with follow(leader, robot) as follower:
        run(follower, leader, robot, 0.5)
        leader.fault_injector.freeze(True)
        for _ in range(20):
            leader.fault_injector.move_by_hand(0, 0.01)
            run(follower, leader, robot, PERIOD_S)
        assert not follower.step(PERIOD_S)
        rest = robot.image.position_command.copy()
        leader.fault_injector.move_by_hand(0, 0.3)
        leader.fault_injector.freeze(False)
        leader.step(20)
        commands = run(follower, leader, robot, 0.5)
    speeds = np.abs(np.diff(np.vstack([rest, commands]), axis=0)) / PERIOD_S
    assert speeds.max() <= 1.2 * SPEED, "the robot hurries after a leader that was lost"


def test_a_stop_of_the_robot_ends_it(leader: Robot, robot: Robot) -> None:
    with follow(leader, robot) as follower:
        run(follower, leader, robot, 0.2)
        robot.stop("by the test")
        with pytest.raises(NotReady, match="by the test"):
            run(follower, leader, robot, 1.0)


def test_limits_of_the_robot_hold_beyond_which_a_leader_goes() -> None:
    alignment = Alignment(SPEED)
    wanted, present = np.array([0.0, 1.0]), np.array([0.0, 0.0])
    targets = [alignment.step(wanted, present, 0.1)[1] for _ in range(40)]
    assert np.diff(targets).max() == pytest.approx(0.03)
    assert alignment.aligned
    jumped = alignment.step(np.array([0.0, 0.2]), present, 0.1)
    assert jumped[1] == pytest.approx(0.994)
    assert not alignment.aligned


def test_mappings_are_read_and_checked() -> None:
    leader, arm = load_robot_descriptor("so101_leader"), load_robot_descriptor("cr3a")
    assert parse_mapping("gripper=joint6:-2:0.5") == JointMapping("gripper", "joint6", -2.0, 0.5)
    for wrong in ("gripper", "gripper=joint1:0", "gripper=joint1:x", "=joint1", "gripper=j:1:2:3"):
        with pytest.raises(InvalidArgument, match="is not LEADER=JOINT"):
            parse_mapping(wrong)
    with pytest.raises(InvalidArgument, match="no joints of one name"):
        joint_map(leader, arm, ())
    with pytest.raises(InvalidArgument, match="joint6 is mapped twice"):
        joint_map(leader, arm, [JointMapping(name, "joint6") for name in ("gripper", "wrist_roll")])
    with pytest.raises(InvalidArgument, match="cr3a: unknown joint 'joint7'"):
        joint_map(leader, arm, [JointMapping("gripper", "joint7")])
    assert len(joint_map(leader, load_robot_descriptor("so101"), ())) == 6
