"""Hand guiding in the physics: weight carried, speed damped, held from motion without a return."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plugins.mujoco.cell import Cell, cell

from robotd.api import Operation, Payload

STRETCHED = "initial_position_rad=[0.0,-1.57,0.0,0.0,0.0,0.0]"
PUSH_NM = 10.0
GUIDING = int(Operation.GUIDING)


def test_the_drives_carry_the_weight_and_a_push_moves_the_arm() -> None:
    with cell("scene=null", STRETCHED) as arm:
        robot, data = arm.robot, arm.physics.data
        robot.axes.begin_guiding(list(robot.joint_axes))
        start = robot.image.position.copy()
        robot.step(1000)
        assert robot.image.position == pytest.approx(start, abs=0.01)
        assert abs(robot.image.torque[1]) > 20.0
        data.qfrc_applied[0] = PUSH_NM
        robot.step(100)
        assert robot.image.position[0] > start[0] + 0.05
        assert robot.image.position_command == pytest.approx(robot.image.position)
        assert (robot.image.operation[:6] == GUIDING).all()
        assert not robot.image.amp_alarm.any()


def test_a_guided_arm_in_motion_comes_to_rest_and_does_not_return() -> None:
    with cell("scene=null", STRETCHED) as arm:
        robot, data = arm.robot, arm.physics.data
        joints = list(robot.joint_axes)
        robot.axes.begin_guiding(joints)
        data.qfrc_applied[0] = PUSH_NM
        robot.step(150)
        assert robot.image.velocity[0] > 0.5
        data.qfrc_applied[0] = 0.0
        pushed = float(robot.image.position[0])
        robot.axes.stop(joints)
        positions = []
        for _ in range(500):
            robot.step(1)
            positions.append(float(robot.image.position[0]))
        assert (robot.image.operation[joints] == int(Operation.IDLE)).all()
        assert robot.image.servo_on[joints].all()
        assert pushed <= max(positions) < pushed + 0.2
        assert max(positions) - positions[-1] < 0.005  # it does not spring back
        assert np.ptp(positions[-100:]) < 1e-4
        assert robot.image.position_command[0] == pytest.approx(positions[-1], abs=0.005)


def test_an_arm_that_is_pushed_on_is_held_after_a_time() -> None:
    with cell("scene=null", STRETCHED) as arm:
        robot, data = arm.robot, arm.physics.data
        joints = list(robot.joint_axes)
        robot.axes.begin_guiding(joints)
        data.qfrc_applied[0] = 3 * PUSH_NM
        robot.step(100)
        robot.axes.stop(joints)
        robot.step(500)
        assert (robot.image.operation[joints] == int(Operation.IDLE)).all()
        assert abs(robot.image.velocity[0]) < 0.02
        assert not robot.image.amp_alarm.any()


def test_the_drives_carry_the_payload_that_they_know() -> None:
    payload = Payload(2.0, (0.0, 0.0, 0.1))
    with cell("scene=null", STRETCHED) as arm:
        robot = arm.robot
        hang(arm, payload)
        robot.step(500)
        motor, sunk = float(robot.image.torque[1]), sag(arm)
        robot.payload.set_payload(payload)
        robot.step(500)
        assert robot.image.torque[1] == pytest.approx(motor, rel=0.02)  # it had the weight before
        assert sag(arm) < 0.05 * sunk
        robot.axes.begin_guiding(list(robot.joint_axes))
        start = robot.image.position.copy()
        robot.step(1000)
        assert robot.image.position == pytest.approx(start, abs=0.01)


def test_a_guided_arm_sinks_by_a_weight_that_the_drives_do_not_know() -> None:
    with cell("scene=null", STRETCHED) as arm:
        robot = arm.robot
        hang(arm, Payload(2.0))
        robot.axes.begin_guiding(list(robot.joint_axes))
        start = robot.image.position.copy()
        robot.step(300)
        assert np.abs(robot.image.position - start).max() > 0.05


def hang(arm: Cell, payload: Payload) -> None:
    """Let a weight act at the last link, whatever the drives expect there."""
    physics = arm.physics
    body = physics.robot_model.payload
    physics.model.body_ipos[body] = payload.center_m
    physics.data.xfrc_applied[body, :3] = payload.mass_kg * physics.model.opt.gravity


def sag(arm: Cell) -> float:
    """Return by how much the joint that carries most is off its command, rad."""
    image = arm.robot.image
    return float(abs(image.position_command[1] - image.position[1]))
