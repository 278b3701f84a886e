"""The section of a mobile base: counted as axes, and checked against the joints."""

from pathlib import Path

import pytest

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.errors import DescriptorError
from robotd_bases.diff_drive import DifferentialDrive, SkidSteerDrive
from robotd_bases.mecanum import MecanumDrive

BASE = """\
schema: 1
name: base
drive:
  left_axis: 2
  right_axis: 3
  wheel_radius_m: 0.1
  wheel_separation_m: 0.5
  velocity_m_s: 1.0
  acceleration_m_s2: 1.0
  deceleration_m_s2: 1.0
  angular_velocity_rad_s: 1.0
  angular_acceleration_rad_s2: 1.0
  angular_deceleration_rad_s2: 1.0
"""
JOINT = "{name: a, axis: 2, lower_rad: -1, upper_rad: 1, velocity_rad_s: 2, acceleration_rad_s2: 3}"


def load(folder: Path, text: str) -> RobotDescriptor:
    path = folder / "robot.yaml"
    path.write_text(text)
    return load_robot_descriptor(path)


def test_wheels_count_as_axes_and_have_defaults(tmp_path: Path) -> None:
    robot = load(tmp_path, BASE)
    assert robot.axes == 4
    assert robot.drive is not None
    assert robot.drive.axes == (2, 3)
    assert robot.drive.command_timeout_s == 0.5
    assert robot.drive.wheel_wrap_rad is None


@pytest.mark.parametrize(
    ("text", "where"),
    [
        (BASE.replace("right_axis: 3", "right_axis: 2"), "drive.right_axis: used before"),
        (BASE + "axes: 3\n", r"drive.right_axis: must be less than axes \(3\)"),
        (BASE + f"joints: [{JOINT}]\n", "drive.left_axis: used before, by joints.0.axis"),
        (BASE.replace("wheel_radius_m: 0.1", "wheel_radius_m: 0"), "drive.wheel_radius_m"),
        (BASE.replace("  velocity_m_s: 1.0\n", ""), "drive.velocity_m_s"),
    ],
)
def test_a_wrong_drive_is_told_by_its_key(tmp_path: Path, text: str, where: str) -> None:
    with pytest.raises(DescriptorError, match=where):
        load(tmp_path, text)


MECANUM = """\
schema: 1
name: rover
drive:
  kind: mecanum
  front_left_axis: 0
  front_right_axis: 1
  rear_left_axis: 2
  rear_right_axis: 3
  wheel_radius_m: 0.1
  wheel_separation_m: 0.5
  wheelbase_m: 0.6
  velocity_m_s: 1.0
  acceleration_m_s2: 1.0
  deceleration_m_s2: 1.0
  lateral_velocity_m_s: 0.5
  lateral_acceleration_m_s2: 1.0
  lateral_deceleration_m_s2: 1.0
  angular_velocity_rad_s: 1.0
  angular_acceleration_rad_s2: 1.0
  angular_deceleration_rad_s2: 1.0
"""


SKID = BASE.replace("  left_axis: 2\n", "  kind: skid_steer\n  left_axes: [0, 1]\n").replace(
    "right_axis: 3", "right_axes: [2, 3]"
)


def test_a_skid_steer_drive_has_several_wheels_a_side(tmp_path: Path) -> None:
    robot = load(tmp_path, SKID)
    assert isinstance(robot.drive, SkidSteerDrive)
    assert (robot.axes, robot.drive.axes) == (4, (0, 1, 2, 3))
    assert robot.drive.wheels_per_side == 2
    assert robot.drive.wheel_names == (
        "left wheel 1", "left wheel 2", "right wheel 1", "right wheel 2",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "where"),
    [
        (SKID.replace("[2, 3]", "[2]"), r"drive.right_axes: must be as many as left_axes \(2\)"),
        (SKID.replace("[0, 1]", "[]"), "drive.left_axes"),
        (SKID.replace("[0, 1]", "0"), "drive.left_axes"),
        (SKID.replace("[2, 3]", "[2, 1]"), "drive.right_axes.1: used before, by left_axes.1"),
        (SKID + "axes: 3\n", r"drive.right_axes.1: must be less than axes \(3\)"),
        (SKID + f"joints: [{JOINT}]\n", "drive.right_axes.0: used before, by joints.0.axis"),
    ],
)
def test_mistakes_in_a_skid_steer_drive_are_named(tmp_path: Path, text: str, where: str) -> None:
    with pytest.raises(DescriptorError, match=where):
        load(tmp_path, text)


def test_a_drive_is_differential_unless_it_says_otherwise(tmp_path: Path) -> None:
    assert isinstance(load(tmp_path, BASE).drive, DifferentialDrive)


def test_a_mecanum_drive_has_four_wheels(tmp_path: Path) -> None:
    robot = load(tmp_path, MECANUM)
    assert isinstance(robot.drive, MecanumDrive)
    assert (robot.axes, robot.drive.axes) == (4, (0, 1, 2, 3))
    assert robot.drive.wheel_names[2] == "rear left wheel"


@pytest.mark.parametrize(
    ("text", "where"),
    [
        (
            MECANUM.replace("kind: mecanum", "kind: omni"),
            r"robot.yaml:4: drive.kind: unknown kind of base \(available: .*mecanum, .*tricycle\)",
        ),
        (
            MECANUM.replace("rear_left_axis: 2", "rear_left_axis: 1"),
            "robot.yaml:7: drive.rear_left_axis: used before, by front_right_axis",
        ),
        (
            MECANUM.replace("wheelbase_m", "wheelbase"),
            "drive.wheelbase: unknown key; did you mean 'wheelbase_m'",
        ),
        (MECANUM.replace("  wheelbase_m: 0.6\n", ""), "drive.wheelbase_m: missing"),
        (MECANUM.replace("  kind: mecanum\n", ""), "drive.front_left_axis: unknown key"),
        (MECANUM + "  wheel_joints: [a, b]\n", r"drive.wheel_joints: must be as many as wheels"),
        (MECANUM.replace("kind: mecanum", "kind: [1]"), "drive.kind: unknown kind of base"),
        ("schema: 1\nname: rover\ndrive: fast\n", "drive: must be a mapping of keys to values"),
    ],
)
def test_mistakes_in_a_kind_of_base_are_named(tmp_path: Path, text: str, where: str) -> None:
    with pytest.raises(DescriptorError, match=where):
        load(tmp_path, text)


def test_each_axis_has_a_ramp_of_a_controlled_stop(tmp_path: Path) -> None:
    """A bare axis has none; a steering axis has that of steering, not that of the wheels."""
    robot = load(tmp_path, f"{BASE}axes: 5\njoints: [{JOINT.replace('axis: 2', 'axis: 0')}]\n")
    assert robot.stop_decelerations == (3.0, None, 10.0, 10.0, None)
    assert load_robot_descriptor("tricycle_base").stop_decelerations == (10.0, 6.0)
