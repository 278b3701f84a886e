"""The application against a whole robot, at four times its speed."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pick_and_place.arm import Arm, ArmFailed
from pick_and_place.carry import LEFT, RIGHT, carry

from robotd_testing.served_robot import RobotUnderTest

SOURCE = Path(__file__).parents[1] / "src"
Start = Callable[..., RobotUnderTest]


@pytest.fixture
def robot(robotd_robot: Start) -> RobotUnderTest:
    return robotd_robot("cr3a", time_scale=4.0)


def test_a_part_is_carried(robot: RobotUnderTest) -> None:
    with Arm() as arm:
        carry(arm, LEFT, RIGHT)
    robot.wait_standstill()
    wanted = dict(zip(robot.joint_positions, RIGHT.above.joints, strict=True))
    assert robot.joint_positions == pytest.approx(wanted, abs=1e-3)
    assert not robot.gripper_closed


def test_a_part_is_held_when_a_drive_fails_on_the_way(robot: RobotUnderTest) -> None:
    robot.inject("amp_alarm", axis=0, when={"joint": "joint1", "below_rad": -0.1})
    with Arm() as arm, pytest.raises(ArmFailed, match=r"joint1 .* amplifier alarm"):
        carry(arm, LEFT, RIGHT)
    robot.wait_standstill()
    assert robot.gripper_closed
    assert -0.4 < robot.joint_positions["joint1"] < -0.1


def test_the_work_goes_on_after_the_alarm_is_cleared(robot: RobotUnderTest) -> None:
    robot.fail(axis=1, at_s=1.0)
    with Arm() as arm:
        with pytest.raises(ArmFailed):
            carry(arm, LEFT, RIGHT)
        robot.wait_standstill()
        robot.robot.servos.enable()
        carry(arm, LEFT, RIGHT)
    assert not robot.gripper_closed


def test_the_program_says_why_it_failed(robot: RobotUnderTest) -> None:
    robot.inject("communication_drop", when={"joint": "joint1", "below_rad": -0.1})
    command = [sys.executable, "-m", "pick_and_place.main"]
    result = subprocess.run(
        command,
        env=os.environ | {"PYTHONPATH": str(SOURCE)},
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert result.returncode == 1
    assert "communication has ended" in result.stderr
