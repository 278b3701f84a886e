"""Joints by type: the keys of each, and limits in its unit."""

import math
from pathlib import Path

import pytest

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.errors import DescriptorError

RAIL = (
    "{name: rail, axis: 0, type: prismatic, lower_m: 0, upper_m: 0.4, velocity_m_s: 1,"
    " acceleration_m_s2: 5}"
)
TURNTABLE = "{name: table, axis: 1, type: continuous, velocity_rad_s: 2, acceleration_rad_s2: 8}"


def load(folder: Path, *joints: str) -> RobotDescriptor:
    lines = "".join(f"  - {joint}\n" for joint in joints)
    path = folder / "robot.yaml"
    path.write_text(f"schema: 1\nname: rig\njoints:\n{lines}")
    return load_robot_descriptor(path)


def test_each_type_has_limits_in_its_unit(tmp_path: Path) -> None:
    rail, table = load(tmp_path, RAIL, TURNTABLE).joints
    assert (rail.lower, rail.upper, rail.velocity, rail.acceleration) == (0.0, 0.4, 1.0, 5.0)
    assert (rail.unit, table.unit) == ("m", "rad")
    assert (table.lower, table.upper, table.velocity) == (-math.inf, math.inf, 2.0)


def test_the_rated_effort_is_a_force_of_a_prismatic_joint(tmp_path: Path) -> None:
    rail = load(tmp_path, RAIL.replace("}", ", rated_force_n: 120}")).joints[0]
    assert rail.rated_effort == 120.0


@pytest.mark.parametrize(
    ("joint", "problem"),
    [
        (RAIL.replace("upper_m: 0.4, ", ""), "joints.0.upper_m: missing"),
        (RAIL.replace("upper_m: 0.4", "upper_m: -1"), ("joints.0.lower_m: must be less than upper_m"
         " (-1.0) (value 0.0)")),
        (RAIL.replace("upper_m", "upper_rad"), ("joints.0.upper_rad: a prismatic joint has no such"
         " key; use upper_m (value 0.4)")),
        (RAIL.replace("}", ", rated_torque_nm: 2}"), ("joints.0.rated_torque_nm: a prismatic joint"
         " has no such key; use rated_force_n (value 2)")),
        (TURNTABLE.replace("}", ", upper_rad: 1}"), ("joints.0.upper_rad: a continuous joint has no"
         " such key; use type: revolute for a joint with an end (value 1)")),
        (TURNTABLE.replace("velocity_rad_s: 2, ", ""), "joints.0.velocity_rad_s: missing"),
        (RAIL.replace("prismatic", "linear"), ("joints.0.type: must be 'revolute', 'continuous' or"
         " 'prismatic' (value 'linear')")),
    ],
)  # fmt: skip
def test_keys_that_do_not_fit_the_type_are_named(tmp_path: Path, joint: str, problem: str) -> None:
    with pytest.raises(DescriptorError) as error:
        load(tmp_path, joint)
    assert f"robot.yaml:4: {problem}" in str(error.value)


def test_all_problems_of_a_joint_come_at_once(tmp_path: Path) -> None:
    with pytest.raises(DescriptorError) as error:
        load(tmp_path, "{name: rail, axis: 0, type: prismatic, lower_rad: 0, speed: 1}")
    text = str(error.value)
    for key in ("lower_m", "upper_m", "velocity_m_s", "acceleration_m_s2"):
        assert f"joints.0.{key}: missing" in text
    assert "joints.0.lower_rad: a prismatic joint" in text
    assert "joints.0.speed: unknown key" in text
