"""URDF files: a tree with limits, or every problem with its element and line."""

import re
from pathlib import Path

import numpy as np
import pytest

from robotd.descriptor.urdf import parse_urdf, read_urdf
from robotd.errors import DescriptorError

URDFS = Path(__file__).parents[2] / "urdf"
PATH = Path("arm.urdf")
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'


def joint(name: str, parent: str, child: str, inside: str = LIMIT, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/>{inside}</joint>\n'
    )


def links(*names: str) -> str:
    return "".join(f'<link name="{name}"/>\n' for name in names)


def problems(body: str) -> list[str]:
    with pytest.raises(DescriptorError) as error:
        parse_urdf(f'<robot name="arm">\n{body}</robot>\n'.encode(), PATH)
    return str(error.value).splitlines()


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        (joint("a", "base", "tip", "") + links("base", "tip"),
         "arm.urdf:2: a: a revolute joint needs <limit lower= upper= effort= velocity=>"),
        (joint("a", "base", "tip", '<limit lower="0" upper="1"/>') + links("base", "tip"),
         "arm.urdf:2: a: <limit> has no velocity"),
        (joint("a", "base", "tip", LIMIT.replace('"2"', '"0"')) + links("base", "tip"),
         "arm.urdf:2: a: velocity='0' must be above 0"),
        (joint("a", "base", "tip", LIMIT.replace('"2"', '"nan"')) + links("base", "tip"),
         "arm.urdf:2: a: velocity='nan' is not a finite number"),
        (joint("a", "base", "tip", LIMIT.replace('"-1"', '"2"')) + links("base", "tip"),
         "arm.urdf:2: a: lower limit 2 is not below upper 1"),
        (joint("a", "base", "tip", LIMIT + '<origin xyz="0 0"/>') + links("base", "tip"),
         "arm.urdf:2: a: xyz='0 0' is not three finite numbers"),
        (joint("a", "base", "tip", LIMIT + '<origin rpy="0 inf 0"/>') + links("base", "tip"),
         "arm.urdf:2: a: rpy='0 inf 0' is not three finite numbers"),
        (joint("a", "base", "tip", LIMIT + '<axis xyz="0 0 0"/>') + links("base", "tip"),
         "arm.urdf:2: a: axis 0 0 0 has no direction"),
        (joint("a", "base", "tip", LIMIT + '<mimic joint="b"/>') + links("base", "tip"),
         "arm.urdf:2: a: mimics joint 'b', which is none"),
        (joint("a", "base", "tip", LIMIT + '<mimic joint="a"/>') + links("base", "tip"),
         "arm.urdf:2: a: mimics itself: a → a"),
        (joint("a", "base", "tipp") + links("base", "tip"),
         "arm.urdf:2: a: child link 'tipp' does not exist; did you mean 'tip'?"),
        (joint("a", "base", "tip", kind="floating") + links("base", "tip"),
         "arm.urdf:2: a: a floating joint is not driven by one axis: make it fixed"),
        (joint("a", "base", "tip", kind="hinge") + links("base", "tip"),
         "arm.urdf:2: a: type 'hinge' is unknown (available: revolute, continuous, prismatic"),
        (joint("a", "base", "tip") + joint("a", "tip", "end") + links("base", "tip", "end"),
         "arm.urdf:3: a: joint name is used before, on line 2"),
        (joint("a", "base", "tip") + links("base", "tip", "tip"),
         "arm.urdf:5: tip: link name is used before, on line 4"),
        (joint("a", "base", "tip") + joint("b", "base", "tip") + links("base", "tip"),
         "arm.urdf:3: b: child link 'tip' is held by joint 'a' already"),
        (joint("a", "one", "two") + joint("b", "two", "one") + links("one", "two"),
         "arm.urdf:2: a: links form a loop: "),
        (joint("a", "base", "tip") + links("base", "tip", "island"),
         "arm.urdf:5: island: link is a second root, beside 'base': no joint connects it"),
        ("", "arm.urdf:1: has no link"),
    ],
)  # fmt: skip
def test_a_problem_names_element_and_line(body: str, problem: str) -> None:
    found = problems(body)
    assert len(found) == 1
    assert found[0].startswith(problem)


def test_all_problems_come_at_once_in_the_order_of_the_file() -> None:
    found = problems(
        joint("a", "base", "arm", "")
        + joint("b", "arm", "tip", LIMIT.replace('"5"', '"much"'))
        + joint("c", "tip", "end", '<mimic joint="d"/>' + LIMIT)
        + links("base", "arm", "tip")
    )
    lines = [int(re.findall(r":(\d+):", each)[0]) for each in found]
    assert lines == [2, 3, 4, 4]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("<robot>", "arm.urdf:1: not XML: "),
        ('<sdf version="1.6"/>', "arm.urdf:1: begins with <sdf>, not <robot>: no URDF"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro">\n<xacro:arm/></robot>',
         "arm.urdf:2: is xacro, not URDF: run 'xacro FILE > NAME.urdf' and pass the result"),
    ],
)  # fmt: skip
def test_other_files_are_named(text: str, problem: str) -> None:
    with pytest.raises(DescriptorError, match=re.escape(problem)):
        parse_urdf(text.encode(), PATH)


def test_poses_follow_the_joints() -> None:
    gantry = read_urdf(URDFS / "gantry.urdf")
    pose = gantry.pose("gantry_link3", {"gantry_joint1": 1.5, "gantry_joint2": -0.2,
                                        "gantry_joint3": -0.3})  # fmt: skip
    assert pose[:3, 3] == pytest.approx([1.5, -0.2, -0.3])
    assert np.array_equal(pose[:3, :3], np.eye(3))


def test_a_mimic_joint_follows_its_leader() -> None:
    arm = read_urdf(URDFS / "six_axis.urdf")
    opposite = arm.position(arm.joint["right_finger_joint"], {"left_finger_joint": 0.3})
    assert opposite == -0.3
