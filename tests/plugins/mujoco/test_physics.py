"""Drives, brakes, gravity and faults of the simulated arm."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from tests.plugins.mujoco.cell import LEFT, cell

from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import load_robot_descriptor
from robotd_mujoco.device import MujocoDevice
from robotd_mujoco.fault_injector import MujocoFaultInjector
from robotd_mujoco.options import MujocoOptions
from robotd_mujoco.physics import Physics

STRETCHED = "initial_position_rad=[0.0,-1.57,0.0,0.0,0.0,0.0]"
HELD_RAD = 1e-3
MILLISECOND = 1_000_000


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


class LateClock:
    """Time that passes before the physics is asked for it, as on a busy computer."""

    def __init__(self) -> None:
        self.ns = 0

    def now_ns(self) -> int:
        return self.ns


def late_arm() -> tuple[Physics, LateClock]:
    """Return an arm with a payload, close above a cube, whose servos are off."""
    robot = load_robot_descriptor("cr3a")
    section = {**robot.backends["mujoco"], "initial_position_rad": LEFT}
    clock = LateClock()
    return Physics(robot, MujocoOptions.model_validate(section), clock), clock  # type: ignore[arg-type]


@pytest.mark.parametrize("late", [1, 20, 100])
def test_brakes_hold_from_the_first_step_however_late_it_is(late: int) -> None:
    physics, clock = late_arm()
    for _ in range(400 // late):
        clock.ns += late * MILLISECOND
        physics.advance()
    assert physics.positions()[:6] == pytest.approx(LEFT, abs=1e-4)


@pytest.mark.parametrize("late", [1, 20, 100])
def test_brakes_stop_a_loaded_arm_that_trips_in_motion(late: int) -> None:
    physics, clock = late_arm()
    physics.talking = True
    for axis in range(physics.axes):
        physics.enable(axis)
    targets = physics.positions().copy()
    for _ in range(150):
        targets[1:3] += (-0.002, 0.002)
        physics.follow(targets)
        clock.ns += 2 * MILLISECOND
        physics.advance()
    assert physics.velocities()[2] > 0.9
    before = physics.positions().copy()
    for axis in range(physics.axes):
        physics.trip(axis, 1)
    for _ in range(800 // late):
        clock.ns += late * MILLISECOND
        physics.advance()
    assert physics.positions() == pytest.approx(before, abs=2e-3)
    assert physics.velocities() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    "fault",
    [
        lambda faults: faults.drop_communication(),
        lambda faults: faults.stop_engine(),
        lambda faults: faults.disconnect(1),
        lambda faults: faults.trip(1, 1),
        lambda faults: MujocoDevice(faults._physics).close(),
    ],
    ids=["drop_communication", "stop_engine", "disconnect", "trip", "close"],
)
def test_a_fault_acts_at_its_time_whoever_has_looked(
    fault: Callable[[MujocoFaultInjector], None],
) -> None:
    ends = []
    for looks in (False, True):
        physics, clock = late_arm()
        physics.is_open = physics.talking = True
        for axis in range(physics.axes):
            physics.enable(axis)
        targets = physics.positions()
        for _ in range(100):
            targets[1] -= 0.002
            physics.follow(targets)
            clock.ns += 2 * MILLISECOND
            physics.advance()
        clock.ns += 20 * MILLISECOND
        if looks:
            physics.advance()
        fault(MujocoFaultInjector(physics))
        clock.ns += 100 * MILLISECOND
        physics.advance()
        ends.append(physics.positions().tolist())
    assert ends[0] == ends[1]


def test_a_joint_without_a_brake_falls_and_is_enabled_without_a_jump() -> None:
    with cell("scene=null", "brakes=false", STRETCHED) as arm:
        robot = arm.robot
        robot.axes.servo(1, False)
        start = float(robot.image.position[1])
        robot.step(60)
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
        arm.physics.data.qpos[:6] = (0.0, 0.0, 2.8, 0.0, 0.0, 0.0)
        mujoco.mj_forward(arm.physics.model, arm.physics.data)
        assert arm.physics.data.ncon > 0
    with cell("scene=null", "self_collision=false", start=False) as arm:
        arm.physics.data.qpos[:6] = (0.0, 0.0, 2.8, 0.0, 0.0, 0.0)
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
