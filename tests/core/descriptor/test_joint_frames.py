"""Forward kinematics against pytransform3d, which reads the URDF by itself."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from pytransform3d.urdf import UrdfTransformManager
from scipy.spatial.transform import Rotation

from robotd.arrays import FloatArray
from robotd.descriptor.urdf import JointFrames, UrdfRobot, parse_urdf, read_urdf, transform_numbers

HERE = Path(__file__).parents[2]
FILES = sorted([*HERE.glob("urdf/*.urdf"), *HERE.parent.glob("robots/*/*.urdf")])
EXACT = 1e-12

PAIR = """
<robot name="pair">
  <link name="root"/><link name="slide"/><link name="copy"/>
  <link name="plate"/><link name="caster"/>
  <joint name="lift" type="prismatic"><parent link="root"/><child link="slide"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 3.1"/><axis xyz="0 3 4"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <joint name="mirror" type="revolute"><parent link="slide"/><child link="copy"/>
    <axis xyz="1 1 0"/><mimic joint="lift" multiplier="-2" offset="0.5"/>
    <limit lower="-9" upper="9" velocity="1" effort="1"/></joint>
  <joint name="bolt" type="fixed"><parent link="copy"/><child link="plate"/>
    <origin xyz="0 0 1" rpy="0 0 3.141592653589793"/></joint>
  <joint name="caster_joint" type="continuous"><parent link="root"/><child link="caster"/>
    <origin xyz="-1 0 0"/><axis xyz="0 0 1"/></joint>
</robot>"""


def reference(path: Path, positions: Mapping[str, float]) -> dict[str, FloatArray]:
    """Frame of each link in the root, (4, 4), by pytransform3d.

    It does not follow mimic joints: they are set like others, to what the XML says.
    """
    root = etree.parse(path).getroot()
    model = UrdfTransformManager()
    model.load_urdf(etree.tostring(root, encoding="unicode"))
    joints = {joint.get("name"): joint for joint in root.findall("joint")}

    def position(name: str) -> float:
        mimic = joints[name].find("mimic")
        if mimic is None:
            return positions.get(name, 0.0)
        ratio, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
        return ratio * position(mimic.get("joint")) + offset

    for name, joint in joints.items():
        if joint.get("type") != "fixed":
            lower, upper = model.get_joint_limits(name)
            assert lower <= position(name) <= upper, f"{name}: pytransform3d would clip it"
            model.set_joint(name, position(name))
    base = read_urdf(path).root
    links = [link.get("name") for link in root.findall("link")]
    return {link: model.get_transform(link, base) for link in links}


def of_numbers(numbers: FloatArray) -> FloatArray:
    frame = np.eye(4)
    frame[:3, 3], frame[:3, :3] = numbers[:3], Rotation.from_quat(numbers[3:]).as_matrix()
    return frame


def composed(urdf: UrdfRobot, frames: JointFrames, positions: FloatArray) -> dict[str, FloatArray]:
    """Frame of each link in the root, from the transforms of all joints, as tf composes them."""
    rows = np.concatenate([frames.transforms(positions), frames.still_transforms()])
    joints = (*frames.moving, *frames.still)
    steps = {joint.child: of_numbers(row) for joint, row in zip(joints, rows, strict=True)}

    def frame(link: str) -> FloatArray:
        if link == urdf.root:
            return np.eye(4)
        return frame(urdf.parent_joint[link].parent) @ steps[link]

    return {link: frame(link) for link in urdf.links}


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    path = tmp_path / "pair.urdf"
    path.write_text(PAIR)
    return path


def check_against_reference(path: Path, names: list[str], seed: int) -> None:
    urdf = read_urdf(path)
    frames = JointFrames(urdf, names)
    joints = [urdf.joint[name] for name in names]
    lower = np.clip([joint.lower for joint in joints], -3.0, 0.0)
    upper = np.clip([joint.upper for joint in joints], 0.0, 3.0)
    positions = np.random.default_rng(seed).uniform(lower, upper)
    known = dict(zip(names, map(float, positions), strict=True))
    tree = composed(urdf, frames, positions)
    for link, expected in reference(path, known).items():
        assert urdf.pose(link, known) == pytest.approx(expected, abs=EXACT), link
        assert tree[link] == pytest.approx(expected, abs=EXACT), link


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_link_of_every_robot_is_where_pytransform3d_has_it(path: Path, seed: int) -> None:
    joints = read_urdf(path).joints
    names = [joint.name for joint in joints if joint.moves and not joint.mimic]
    check_against_reference(path, names, seed)


@pytest.mark.parametrize("seed", range(3))
def test_tilted_axes_mimics_and_joints_without_a_position(pair: Path, seed: int) -> None:
    check_against_reference(pair, ["lift"], seed)


def test_joints_that_follow_nothing_are_still(pair: Path) -> None:
    frames = JointFrames(read_urdf(pair), ["lift"])
    assert [joint.name for joint in frames.moving] == ["lift", "mirror"]
    assert [joint.name for joint in frames.still] == ["bolt", "caster_joint"]


def test_a_robot_without_fixed_joints_has_no_still_ones() -> None:
    text = '<robot name="one"><link name="only"/></robot>'
    frames = JointFrames(parse_urdf(text.encode(), Path("one.urdf")), [])
    assert frames.still_transforms().shape == (0, 7)
    assert frames.transforms(np.zeros(0)).shape == (0, 7)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 2, 3), (-1, 1, 0)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi / 2, np.pi - 1e-9, np.pi, -3.0, 4.0])
def test_quaternions_of_all_rotations(axis: tuple[int, int, int], angle: float) -> None:
    rotation = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis))
    frame = np.eye(4)
    frame[:3, :3] = rotation.as_matrix()
    x, y, z, w = transform_numbers(frame)[3:]
    assert w >= 0.0
    assert Rotation.from_quat([x, y, z, w]).as_matrix() == pytest.approx(
        rotation.as_matrix(), abs=1e-9
    )
