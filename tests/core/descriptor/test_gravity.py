"""Gravity torques against the gradient of the potential energy, and against MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robotd.arrays import FloatArray
from robotd.descriptor.urdf import STANDARD_GRAVITY, GravityModel, UrdfRobot, parse_urdf, read_urdf

ROBOTS = Path(__file__).parents[3] / "robots"
STEP = 1e-5  # rad or m, of the numerical gradient

# A joint that slides obliquely, one that copies it, masses on plates, a wheel that nothing moves.
MIXED = """
<robot name="mixed">
  <link name="root"><inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
    izz="1"/></inertial></link>
  <link name="slide">{mass}</link><link name="copy">{mass}</link><link name="plate">{mass}</link>
  <link name="arm">{mass}</link><link name="tip"/><link name="wheel">{mass}</link>
  <joint name="lift" type="prismatic"><parent link="root"/><child link="slide"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 3.1"/><axis xyz="0 3 4"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <joint name="mirror" type="revolute"><parent link="slide"/><child link="copy"/>
    <axis xyz="1 1 0"/><mimic joint="lift" multiplier="-2" offset="0.5"/>
    <limit lower="-9" upper="9" velocity="1" effort="1"/></joint>
  <joint name="bolt" type="fixed"><parent link="copy"/><child link="plate"/>
    <origin xyz="0 0 1" rpy="0 0.3 2"/></joint>
  <joint name="turn" type="revolute"><parent link="plate"/><child link="arm"/>
    <origin xyz="0.2 0 0.1" rpy="1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="flange" type="fixed"><parent link="arm"/><child link="tip"/></joint>
  <joint name="roll" type="continuous"><parent link="arm"/><child link="wheel"/>
    <origin xyz="-1 0 0"/><axis xyz="0 0 1"/></joint>
</robot>""".format(
    mass='<inertial><origin xyz="0.1 -0.2 0.3" rpy="0 0 0.5"/><mass value="2.5"/><inertia'
    ' ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
)


def mixed() -> UrdfRobot:
    return parse_urdf(MIXED, Path("mixed.urdf"))


def potential_energy(urdf: UrdfRobot, positions: dict[str, float]) -> float:
    energy = 0.0
    for link in urdf.links.values():
        if link.mass is not None and link.name != urdf.root:
            height = (urdf.pose(link.name, positions) @ np.append(link.center, 1.0))[2]
            energy += link.mass * STANDARD_GRAVITY * float(height)
    return energy


def gradient(urdf: UrdfRobot, names: list[str], positions: FloatArray) -> list[float]:
    found = []
    for column in range(len(names)):
        energies = []
        for sign in (1.0, -1.0):
            moved = positions.copy()
            moved[column] += sign * STEP
            energies.append(potential_energy(urdf, dict(zip(names, moved, strict=True))))
        found.append((energies[0] - energies[1]) / (2.0 * STEP))
    return found


@pytest.mark.parametrize("name", ["cr3a", "fr3", "so101", "scara", "gantry", "mixed"])
def test_torques_are_the_gradient_of_the_potential_energy(name: str) -> None:
    urdf = mixed() if name == "mixed" else read_urdf(ROBOTS / name / f"{name}.urdf")
    names = [joint.name for joint in urdf.joints if joint.moves and joint.mimic is None]
    names = [joint for joint in names if joint != "roll"][::-1]  # in another order than the file
    model, random = GravityModel(urdf, names), np.random.default_rng(1)
    largest = 0.0
    for _ in range(10):
        positions = random.uniform(-2.0, 2.0, len(names))
        torques = model.torques(positions)
        assert torques == pytest.approx(gradient(urdf, names, positions), abs=1e-5)
        largest = max(largest, float(np.abs(torques).max()))
    assert largest > 0.3  # else it would agree with anything


def test_torques_are_those_of_mujoco() -> None:
    """At rest ``qfrc_bias`` is gravity alone."""
    path = ROBOTS / "cr3a" / "cr3a.urdf"
    physics = mujoco.MjModel.from_xml_path(str(path))
    physics.opt.gravity = 0.0, 0.0, -STANDARD_GRAVITY
    data, random = mujoco.MjData(physics), np.random.default_rng(2)
    names = [physics.joint(number).name for number in range(physics.njnt)]
    model = GravityModel(read_urdf(path), names)
    for _ in range(10):
        data.qpos[:] = random.uniform(-3.0, 3.0, physics.nq)
        mujoco.mj_forward(physics, data)
        assert model.torques(data.qpos) == pytest.approx(data.qfrc_bias, abs=1e-6)
    assert np.abs(data.qfrc_bias).max() > 1.0


def test_links_without_a_mass_are_named_unless_one_is_fixed_to_them() -> None:
    assert GravityModel(mixed(), ["lift", "turn", "roll"]).massless == []
    without = MIXED.replace('<mass value="2.5"/>', '<mass value="0"/>')
    model = GravityModel(parse_urdf(without, Path("mixed.urdf")), ["lift", "turn"])
    assert model.massless == ["slide", "copy", "arm"]
