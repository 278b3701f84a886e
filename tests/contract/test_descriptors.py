"""Contract of the robots in robots/: valid, complete and documented."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from robotd.descriptor import (
    RobotDescriptor,
    default_search_path,
    list_robots,
    load_robot_descriptor,
)
from robotd_bases.diff_drive import DifferentialDrive
from robotd_wmx_parameters import default_wmx_parameters, read_wmx_parameters, write_wmx_parameters

SERVICE_NODES = ("wmx_engine_node", "wmx_core_motion_node", "wmx_io_node", "wmx_ethercat_node")
MANIPULATOR_STATE = {
    "encoder_joint_topic": "joint_states",
}
TRAJECTORY_SERVER = {
    "wmx_gripper_topic": "wmx/set_gripper",
    "joint_trajectory_action": "movensys_manipulator_arm_controller/follow_joint_trajectory",
}


@pytest.fixture(scope="module")
def cr3a() -> RobotDescriptor:
    return load_robot_descriptor("cr3a")


@pytest.fixture(scope="module")
def urdf(cr3a: RobotDescriptor) -> Any:
    assert cr3a.urdf is not None
    return etree.parse(cr3a.urdf).getroot()


def test_every_robot_is_sound_and_named_as_its_folder() -> None:
    robots = list_robots()
    assert {"baymax", "cr3a", "standalone"} <= {robot.name for robot in robots}
    for robot in robots:
        assert robot.problem is None
        assert robot.summary
        for variant in robot.variants or (None,):
            assert load_robot_descriptor(robot.name, variant).name == robot.name


def test_every_robot_is_in_the_readme() -> None:
    readme = (default_search_path()[0] / "README.md").read_text()
    for robot in list_robots():
        row = next(line for line in readme.splitlines() if line.startswith(f"| `{robot.name}`"))
        assert all(f"`{variant}`" in row for variant in robot.variants)


def test_cr3a_parameters_of_both_deployments() -> None:
    intel = load_robot_descriptor("cr3a")
    orin = load_robot_descriptor("cr3a", "orin")
    assert intel.variant == "intel"
    assert intel.ros_parameters["manipulator_state"] == MANIPULATOR_STATE | {
        "gazebo_joint_topic": "gazebo_position_controller/commands"
    }
    assert orin.ros_parameters["manipulator_state"] == MANIPULATOR_STATE | {
        "isaacsim_joint_topic": "isaacsim/joint_command"
    }
    for robot in (intel, orin):
        assert robot.ros_parameters["follow_joint_trajectory_server"] == TRAJECTORY_SERVER


def test_standalone_moves_nothing_by_itself() -> None:
    robot = load_robot_descriptor("standalone")
    assert (robot.axes, robot.joints, robot.parameters_file) == (2, (), None)
    assert robot.nodes == SERVICE_NODES


def test_baymax_has_a_base_and_no_joints() -> None:
    robot = load_robot_descriptor("baymax")
    assert robot.drive is not None
    assert robot.nodes == (*SERVICE_NODES, "diff_drive_controller")
    assert robot.ros_parameters == {
        "diff_drive_controller": {
            "rate": 100,
            "cmd_vel_topic": "cmd_vel",
            "encoder_vel_topic": "cmd_vel_check",
            "encoder_omega_topic": "velocity_controller/commands",
            "encoder_odometry_topic": "odom_enc",
        }
    }
    assert (robot.axes, robot.drive.axes) == (2, (0, 1))
    assert isinstance(robot.drive, DifferentialDrive)
    assert (robot.drive.wheel_radius_m, robot.drive.wheel_separation_m) == (0.09, 0.55)


def test_baymax_parameter_file(tmp_path: Path) -> None:
    robot = load_robot_descriptor("baymax")
    assert robot.parameters_file is not None
    parameters = read_wmx_parameters(robot.parameters_file)
    assert list(parameters["AxisGearRatioNumerator"][:2]) == [52953088] * 2
    assert np.all(parameters["AxisGearRatioDenominator"][:2] == 2 * np.pi)
    assert list(parameters["AxisPolarity"][:2]) == [-1, -1]
    assert list(parameters["AxisCommandMode"][:3]) == [1, 1, 0]
    assert np.all(parameters["AbsoluteEncoderMode"][:2])
    write_wmx_parameters(parameters, tmp_path / "again.xml")
    assert (tmp_path / "again.xml").read_bytes() == robot.parameters_file.read_bytes()


@pytest.mark.parametrize("name", ["baymax", "cr3a"])
def test_ethercat_has_the_scales_of_the_parameter_file(name: str) -> None:
    robot = load_robot_descriptor(name)
    assert robot.parameters_file is not None
    parameters = read_wmx_parameters(robot.parameters_file)
    section = robot.backends["ethercat"]
    for item in section["axes"]:
        keys = {**section.get("axis_defaults", {}), **item}
        counts, per_unit = (
            parameters[f"AxisGearRatio{part}"][item["axis"]]
            for part in ("Numerator", "Denominator")
        )
        assert keys["counts_per_rad"] == pytest.approx(counts / per_unit, rel=1e-9)
        assert keys["polarity"] == parameters["AxisPolarity"][item["axis"]]


def test_baymax_urdf_has_the_wheels_of_the_descriptor() -> None:
    robot = load_robot_descriptor("baymax")
    assert robot.urdf is not None
    assert isinstance(robot.drive, DifferentialDrive)
    root = etree.parse(robot.urdf).getroot()
    for side, sign in (("left", 1), ("right", -1)):
        joint = root.find(f"joint[@name='{side}_wheel_joint']")
        wheel = root.find(f"link[@name='{side}_wheel']/visual/geometry/cylinder")
        assert joint is not None
        assert wheel is not None
        place = [float(number) for number in joint.find("origin").get("xyz").split()]
        assert place == [0, sign * robot.drive.wheel_separation_m / 2, 0]
        assert float(wheel.get("radius")) == robot.drive.wheel_radius_m
        assert float(joint.find("limit").get("velocity")) == robot.drive.wheel_velocity_rad_s


def test_cr3a_parameter_file(cr3a: RobotDescriptor, tmp_path: Path) -> None:
    assert cr3a.parameters_file is not None
    parameters = read_wmx_parameters(cr3a.parameters_file)
    counts_per_turn = [2**19 * 101] * 2 + [2**19 * 81] * 4
    assert list(parameters["AxisGearRatioNumerator"][:6]) == counts_per_turn
    assert np.all(parameters["AxisGearRatioDenominator"][:6] == 2 * np.pi)
    assert list(parameters["AxisPolarity"][:6]) == [-1, -1, 1, -1, -1, -1]
    assert np.all(parameters["AbsoluteEncoderMode"][:6])
    assert np.all(parameters["InPosWidth"][:6] == 0.001)
    changed = {
        name
        for name, column in default_wmx_parameters().columns.items()
        if not np.array_equal(column, parameters[name])
    }
    assert changed == {
        "AxisGearRatioNumerator",
        "AxisGearRatioDenominator",
        "AxisPolarity",
        "AbsoluteEncoderMode",
        "InPosWidth",
    }
    write_wmx_parameters(parameters, tmp_path / "again.xml")
    written = (tmp_path / "again.xml").read_text(encoding="utf-8")
    shipped = cr3a.parameters_file.read_text(encoding="utf-8")
    is_same = written == re.sub(r"<!--.*?-->\n", "", shipped, flags=re.DOTALL)
    assert is_same  # a report of the difference of the two would take minutes


def test_cr3a_urdf_has_the_joints_and_limits_of_the_descriptor(
    cr3a: RobotDescriptor, urdf: Any
) -> None:
    limits = {joint.get("name"): joint.find("limit") for joint in urdf.iter("joint")}
    assert cr3a.gripper is not None
    assert set(limits) == {*cr3a.joint_names, *cr3a.gripper.joints}
    for joint in cr3a.joints:
        limit = limits[joint.name]
        assert float(limit.get("lower")) == joint.lower_rad
        assert float(limit.get("upper")) == joint.upper_rad
        assert float(limit.get("velocity")) == joint.velocity_rad_s
    for name in cr3a.gripper.joints:
        ends = (float(limits[name].get("lower")), float(limits[name].get("upper")))
        assert ends == (cr3a.gripper.open_m, cr3a.gripper.closed_m)


def test_cr3a_urdf_is_a_tree_of_solid_links(urdf: Any) -> None:
    links = {link.get("name") for link in urdf.iter("link")}
    parents = {
        joint.find("child").get("link"): joint.find("parent").get("link")
        for joint in urdf.iter("joint")
    }
    assert len(parents) == len(list(urdf.iter("joint"))), "a link has two parents"
    assert links - set(parents) == {"base_link"}
    assert set(parents.values()) <= links
    for link in links:
        steps = 0
        while link != "base_link":
            link, steps = parents[link], steps + 1  # noqa: PLW2901
            assert steps < len(links), "a loop"
    for inertia in urdf.iter("inertia"):
        x, y, z = sorted(float(inertia.get(key)) for key in ("ixx", "iyy", "izz"))
        assert 0 < x <= y <= z <= (x + y) * 1.001, "no solid body has such moments"
