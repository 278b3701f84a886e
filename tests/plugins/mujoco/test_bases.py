"""Bases on a floor: they roll, slip where friction is low, and odometry knows no slip."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from tests.plugins.mujoco.cell import cell
from tests.plugins.mujoco.driven_base import driven_base, errors

from robotd.api.bases import PlanarTwist

AHEAD, LEFT_TURN = PlanarTwist(0.5, 0.0), PlanarTwist(0.0, 1.0)
ASIDE = PlanarTwist(0.0, 0.0, 0.4)
SLIPPERY = "wheel_friction=0.05"


@pytest.mark.parametrize("robot", ["baymax", "mecanum_base"])
def test_a_base_drives_one_metre_and_odometry_agrees(robot: str) -> None:
    with driven_base(robot) as base:
        base.drive(AHEAD, 2.0)
        assert (base.truth.x, base.truth.y) == pytest.approx((1.0, 0.0), abs=0.01)
        distance, angle = errors(base.base.pose, base.truth)
        assert distance < 0.005
        assert angle < 0.005


@pytest.mark.parametrize("robot", ["baymax", "mecanum_base"])
def test_a_base_turns_on_the_spot(robot: str) -> None:
    with driven_base(robot) as base:
        base.drive(LEFT_TURN, math.pi / 2)
        assert base.truth.heading == pytest.approx(math.pi / 2, abs=0.02)
        distance, angle = errors(base.base.pose, base.truth)
        assert distance < 0.005
        assert angle < 0.02  # wheels of some width slip in a turn


def test_a_mecanum_base_drives_sideways() -> None:
    with driven_base("mecanum_base") as base:
        base.drive(ASIDE, 2.5)
        assert (base.truth.x, base.truth.y) == pytest.approx((0.0, 1.0), abs=0.01)


@pytest.mark.parametrize("robot", ["baymax", "mecanum_base"])
def test_odometry_does_not_know_that_wheels_slip(robot: str) -> None:
    with driven_base(robot, SLIPPERY) as base:
        base.drive(AHEAD, 1.0)
        distance, _ = errors(base.base.pose, base.truth)
        assert distance > 0.02


@pytest.mark.parametrize("robot", ["baymax", "mecanum_base"])
def test_the_same_commands_lead_to_the_same_place_bit_for_bit(robot: str) -> None:
    ends = []
    for _ in range(2):
        with driven_base(robot) as base:
            base.drive(PlanarTwist(0.4, 0.6), 0.5)
            ends.append(base.physics.data.qpos.copy())
    assert np.array_equal(*ends)


def test_brakes_hold_a_base_whose_servos_are_off() -> None:
    with driven_base("baymax", "gravity_m_s2=[1.0,0.0,-9.81]") as base:  # a slope of 6°
        for axis in (0, 1):
            base.robot.axes.servo(axis, False)
        before = base.truth
        base.robot.step(200)
        assert errors(before, base.truth)[0] < 0.01


def test_an_arm_on_a_base_loads_it_with_its_weight() -> None:
    with driven_base("mobile_manipulator") as base:
        base.robot.step(300)
        data, model = base.physics.data, base.physics.model
        floor = model.geom("floor").id
        on_floor = [contact for contact in data.contact if floor in contact.geom]
        load = sum(float(data.efc_force[contact.efc_address]) for contact in on_floor)
        assert load == pytest.approx(9.81 * float(model.body_mass.sum()), rel=0.02)


def test_the_root_of_a_base_can_be_fixed() -> None:
    with cell("fixed_root=true", robot="baymax", start=False) as arm:
        assert not arm.physics.robot_model.is_free
        assert arm.physics.data.ncon == 0  # the wheels turn in the air


def test_objects_are_seen_from_a_base_that_moves(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("objects: [{name: ball, sphere_m: 0.05, at_m: [2, 0, 0.05], mass_kg: 1}]")
    with driven_base("baymax", f"scene={scene}") as base:
        base.drive(LEFT_TURN, math.pi / 2)
        world = base.robot.world
        assert world is not None
        assert world.poses()[0, :3] == pytest.approx([0.0, -2.0, -0.04], abs=0.05)
        world.place("ball", np.array([1.0, 0.0, -0.04, 0.0, 0.0, 0.0, 1.0]))
        assert world.poses()[0, :2] == pytest.approx([1.0, 0.0], abs=1e-3)
        at = base.physics.data.body("ball").xpos
        assert at == pytest.approx([0.0, 1.0, 0.05], abs=0.03)
