"""Joint groups in a descriptor: every joint in one group, errors with line, group and joint."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.errors import DescriptorError

HEAD = """\
schema: 1
name: arms
joints:
  - {name: a, axis: 0, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}
  - {name: b, axis: 1, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}
  - {name: c, axis: 2, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}
groups:
"""


def load(folder: Path, groups: str) -> RobotDescriptor:
    path = folder / "robot.yaml"
    path.write_text(HEAD + groups)
    return load_robot_descriptor(path)


def test_groups_have_their_joints_in_the_order_of_the_group(tmp_path: Path) -> None:
    robot = load(tmp_path, "  left: {joints: [c, a]}\n  right: {joints: [b]}\n")
    names = {name: [joint.name for joint in group] for name, group in robot.joint_groups.items()}
    assert names == {"left": ["c", "a"], "right": ["b"]}
    assert robot.joint_names == ("a", "b", "c")


def test_a_robot_without_groups_has_one_of_all_joints(tmp_path: Path) -> None:
    robot = load(tmp_path, "  {}\n")
    assert {name: len(group) for name, group in robot.joint_groups.items()} == {"joints": 3}


@pytest.mark.parametrize(
    ("groups", "expected"),
    [
        (
            "  left: {joints: [a, d]}\n  right: {joints: [b, c]}\n",
            "8: groups.left.joints.1: unknown joint 'd' (available: a, b, c) (value 'd')",
        ),
        (
            "  left: {joints: [a, b]}\n  right: {joints: [c, b]}\n",
            "9: groups.right.joints.1: is in group 'left' already (value 'b')",
        ),
        (
            "  left: {joints: [a, a]}\n  right: {joints: [b, c]}\n",
            "8: groups.left.joints.1: is in group 'left' already (value 'a')",
        ),
        (
            "  left: {joints: []}\n  right: {joints: [a, b, c]}\n",
            "8: groups.left.joints: must name a joint (value [])",
        ),
        (
            "  left: {joints: [a]}\n  right: {joints: [b]}\n",
            "6: joints.2.name: is in no group (available: left, right) (value 'c')",
        ),
        (
            "  2: {joints: [a, b, c]}\n",
            "8: groups.2: must begin with a letter and hold only letters, digits and _ (value '2')",
        ),
        ("  left: {joint: [a]}\n", "8: groups.left.joint: unknown key; did you mean 'joints'?"),
    ],
)
def test_wrong_groups_are_rejected(tmp_path: Path, groups: str, expected: str) -> None:
    with pytest.raises(DescriptorError) as caught:
        load(tmp_path, groups)
    assert f"{tmp_path}/robot.yaml:{expected}" in str(caught.value).splitlines()
