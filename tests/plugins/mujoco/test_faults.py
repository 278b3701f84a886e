"""Faults of the drives, the link and the inputs, on a robot of one joint."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.plugins.mujoco.cell import cell
from tests.plugins.mujoco.test_files import robot_file

from robotd.errors import InvalidArgument
from robotd_scenario import FaultSchedule, validate_fault


def test_a_lost_drive_is_back_after_its_time_without_a_hot_connect(tmp_path: Path) -> None:
    with cell(robot=robot_file(tmp_path)) as arm:
        faults = FaultSchedule(arm.robot)
        faults.add(validate_fault({"slave_lost": {"axis": 0, "for_s": 0.2}}))
        arm.robot.step(10)
        assert arm.robot.image.offline[0]
        arm.robot.step(200)
        assert not arm.robot.image.offline[0]
        assert faults.failures() == []


def test_an_input_that_does_not_exist_is_rejected(tmp_path: Path) -> None:
    with cell(robot=robot_file(tmp_path)) as arm:
        fault = validate_fault({"input_bit": {"byte": 64, "bit": 0, "value": True}})
        with pytest.raises(InvalidArgument, match="input byte 64 does not exist, there are 64"):
            FaultSchedule(arm.robot).add(fault)


def test_an_alarm_says_its_reason_again_when_the_drive_is_back(tmp_path: Path) -> None:
    with cell(robot=robot_file(tmp_path)) as arm:
        faults, image = arm.robot.fault_injector, arm.robot.image
        faults.trip(0, 0x2310)
        faults.disconnect(0)
        faults.trip(0, 0x2310)
        arm.robot.step(2)
        assert image.reason[0] == "does not answer: cable or power supply"
        faults.reconnect(0)
        arm.robot.step(2)
        assert image.amp_alarm[0]
        assert image.reason[0] == "continuous overcurrent"


def test_a_lost_drive_keeps_its_last_values_also_with_noise(tmp_path: Path) -> None:
    robot = robot_file(tmp_path, "torque_noise_nm: 1.0, velocity_noise_rad_s: 1.0")
    with cell(robot=robot) as arm:
        image = arm.robot.image
        arm.robot.fault_injector.disconnect(0)
        arm.robot.step(2)
        last = float(image.torque[0]), float(image.velocity[0])
        arm.robot.step(20)
        assert (image.torque[0], image.velocity[0]) == last
