"""The external wrench: frame, sign and units, judged by the force on the simulated hand."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import franky
import numpy as np
import pytest
from tests.plugins.franka.controller import Controller, controller, needs_simulator
from tests.plugins.franka.test_on_controller import arm
from tests.ros.robot_process import wait_until

from robotd import Robot
from robotd.api.robots import Outcome, TrajectoryRequest, WrenchLimits
from robotd_franka.wrench import FLANGE_M, wrench_on_link

FORCE = [4.0, -3.0, 5.0]


def state(estimate: list[float], to_effector: np.ndarray) -> SimpleNamespace:
    return SimpleNamespace(
        K_F_ext_hat_K=np.array(estimate),
        F_T_EE=franky.Affine(to_effector),
        EE_T_K=franky.Affine(np.eye(4)),
    )


def test_what_the_arm_presses_with_acts_on_it_the_other_way() -> None:
    turned = np.eye(4)
    turned[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # x of K is y of the flange
    turned[2, 3] = 0.1
    found = wrench_on_link(state([2.0, 0.0, 5.0, 0.0, 0.0, 0.5], turned))
    lever = 0.1 + FLANGE_M
    np.testing.assert_allclose(found, [0.0, -2.0, -5.0, 2.0 * lever, 0.0, -0.5], atol=1e-12)


def test_zeros_near_a_singular_position_are_no_force() -> None:
    assert np.isnan(wrench_on_link(state([0.0] * 6, np.eye(4)))).all()


@pytest.fixture
def unit() -> Iterator[Controller]:
    with controller() as found:
        yield found


@pytest.fixture
def robot(unit: Controller, tmp_path: Path) -> Iterator[Robot]:
    with arm(tmp_path, unit.address) as found:
        yield found


def near(robot: Robot, unit: Controller) -> bool:
    """Return whether the wrench of robotd is that of the simulation, N and N·m."""
    found = robot.wrenches.of("joints").read()
    shown = np.concatenate([found.force, found.torque])
    return bool(np.allclose(shown, unit.command().wrench, atol=0.1))


@needs_simulator
@pytest.mark.long
def test_a_force_on_the_hand_acts_on_the_last_link(robot: Robot, unit: Controller) -> None:
    sensor = robot.wrenches.of("joints")
    assert sensor.link == "fr3_link7"
    unit.command(force=FORCE)
    wait_until(lambda: near(robot, unit), "the wrench of the force")
    assert np.linalg.norm(sensor.require().force) == pytest.approx(np.linalg.norm(FORCE), abs=0.1)
    unit.command(is_singular=True)
    wait_until(lambda: bool(sensor.problem(sensor.read())), "a wrench that is not known")


@needs_simulator
@pytest.mark.long
def test_a_motion_ends_at_a_force(robot: Robot, unit: Controller) -> None:
    target = robot.image.copy().position + 0.3
    request = TrajectoryRequest.from_rows(robot.joint_names, [20.0], [list(target)])
    limits = WrenchLimits(robot.wrenches.of("joints"), force_n=5.0)
    with robot.follower.follow(request, contact=limits) as execution:
        wait_until(lambda: abs(robot.image.copy().velocity[6]) > 0.005, "motion")
        unit.command(force=FORCE)
        execution.wait(30.0)
    assert execution.outcome is Outcome.CONTACT, execution.message
    assert execution.contact.link == "fr3_link7"
    assert np.abs(target - robot.image.copy().position).max() > 0.05
