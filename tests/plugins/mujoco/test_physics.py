"""Drives, brakes, gravity and faults of the simulated arm."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from tests.plugins.mujoco.cell import LEFT, cell

from robotd.control.trajectory_execution import Outcome

STRETCHED = "initial_position_rad=[0.0,-1.57,0.0,0.0,0.0,0.0]"
HELD_RAD = 1e-3


def test_drives_hold_the_weight_and_measure_it() -> None:
    with cell("scene=null", STRETCHED) as arm:
        arm.robot.step(500)
        image, data = arm.robot.image, arm.physics.data
        assert image.position == pytest.approx([0.0, -1.57, 0.0, 0.0, 0.0, 0.0], abs=HELD_RAD)
        assert abs(image.torque[1]) > 20.0
        weight = data.qfrc_bias[1] - data.qfrc_passive[1]
        assert image.torque[1] == pytest.approx(weight, rel=0.01)


def test_brakes_hold_a_joint_whose_servo_is_off() -> None:
    with cell("scene=null", STRETCHED) as arm:
        arm.robot.axes.servo(1, False)
        before = arm.robot.image.position.copy()
        arm.robot.step(1000)
        assert arm.robot.image.position == pytest.approx(before, abs=HELD_RAD)
        assert arm.robot.image.torque[1] == 0.0


def test_a_joint_without_a_brake_falls_and_is_enabled_without_a_jump() -> None:
    with cell("scene=null", "brakes=false", STRETCHED) as arm:
        robot = arm.robot
        robot.axes.servo(1, False)
        start = float(robot.image.position[1])
        robot.step(150)
        fallen = float(robot.image.position[1])
        assert abs(fallen - start) > 0.1
        robot.axes.servo(1, True)
        robot.step(250)
        assert abs(robot.image.position[1] - fallen) < 0.3
        assert abs(robot.image.velocity[1]) < 0.01


def test_the_torque_stays_within_its_limit_and_a_collision_trips_the_drive() -> None:
    with cell() as arm:
        execution = arm.go((LEFT[0], -0.4, *LEFT[2:]), 3.0)  # through the table
        assert execution.outcome in (Outcome.FAULT, Outcome.PATH_TOLERANCE), execution.message
        limits = arm.physics.model.jnt_actfrcrange[:6, 1]
        assert (np.abs(arm.robot.image.torque) <= limits + 1e-9).all()


def test_a_state_that_diverges_is_an_alarm_and_not_a_jump() -> None:
    with cell() as arm:
        robot, data = arm.robot, arm.physics.data
        before = robot.image.position.copy()
        arm.physics.data.qvel[0] = np.nan
        robot.step(5)
        assert robot.image.amp_alarm.all()
        assert set(robot.image.reason) == {"the physics diverged"}
        assert np.isfinite(data.qpos).all()
        assert robot.image.position == pytest.approx(before, abs=HELD_RAD)
        assert not robot.image.servo_on.any()


def test_neighbours_do_not_touch_and_other_links_do() -> None:
    with cell("scene=null", start=False) as arm:
        assert arm.physics.data.ncon == 0
        arm.physics.data.qpos[:6] = (0.0, 2.5, 0.0, 0.0, 0.0, 0.0)
        mujoco.mj_forward(arm.physics.model, arm.physics.data)
        assert arm.physics.data.ncon > 0
    with cell("scene=null", "self_collision=false", start=False) as arm:
        arm.physics.data.qpos[:6] = (0.0, 2.5, 0.0, 0.0, 0.0, 0.0)
        mujoco.mj_forward(arm.physics.model, arm.physics.data)
        assert arm.physics.data.ncon == 0


@pytest.mark.parametrize(
    "robot",
    [
        "baymax",
        "cr5a",
        "dual_cr3a",
        "mecanum_base",
        "mobile_manipulator",
        "skid_steer_base",
        "standalone",
        "tricycle_base",
    ],
)
def test_every_robot_has_a_model(robot: str) -> None:
    with cell(robot=robot) as arm:
        arm.robot.step(100)
        assert not arm.robot.image.amp_alarm.any()
