"""The MoveIt configuration: complete, consistent, and its disabled collisions cannot happen."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from lxml import etree

from robotd.cli import main
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.descriptor.urdf import UrdfRobot, parse_urdf, read_urdf, read_urdf_text
from robotd.errors import DescriptorError
from robotd_export.disabled_collisions import Cover, collision_covers, disabled_collisions
from robotd_export.export_input import ExportInput
from robotd_export.moveit import move_group_parameters
from robotd_export.moveit_package import moveit_package
from robotd_shared.pose_file import write_poses

ROBOTS = ("cr3a", "dual_cr3a", "mobile_manipulator")
SAMPLES = 2000


@pytest.fixture(autouse=True)
def no_poses_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


class Package:
    """Files of a package, parsed."""

    def __init__(self, robot: str) -> None:
        self.source = ExportInput(load_robot_descriptor(robot))
        self.files = moveit_package(self.source)
        self.urdf = parse_urdf(self.files[f"config/{robot}.urdf"], Path("x.urdf"))
        self.srdf = etree.fromstring(self.files[f"config/{robot}.srdf"].encode())

    def content(self, name: str) -> Any:
        return yaml.safe_load(self.files[f"config/{name}.yaml"])


@pytest.fixture(scope="module", params=ROBOTS)
def package(request: pytest.FixtureRequest) -> Package:
    return Package(request.param)


def test_the_srdf_speaks_of_the_urdf(package: Package) -> None:
    urdf, srdf = package.urdf, package.srdf
    assert srdf.get("name") == urdf.name
    links = [
        element.get(key)
        for element in srdf.iter()
        for key in ("base_link", "tip_link")
        if element.get(key)
    ]
    links += [element.get("parent_link") for element in srdf.iterfind("end_effector")]
    links += [
        element.get(key)
        for element in srdf.iterfind("disable_collisions")
        for key in ("link1", "link2")
    ]
    assert links
    assert set(links) <= set(urdf.links)
    joints = {element.get("name") for element in srdf.iter("joint", "passive_joint")}
    assert joints <= set(urdf.joint)


def lifted_gripper(folder: Path, groups: str, nodes: str = "") -> ExportInput:
    """A gripper on an arm that a lift carries, behind a body that is fixed to the last link."""
    joints = (
        ("lift", "torso", "prismatic"), ("elbow", "lift", "revolute"), ("body", "elbow", "fixed"),
        ("a", "body", "prismatic"), ("b", "body", "prismatic"),
    )  # fmt: skip
    parts = "".join(
        f'<link name="{name}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{name}"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>'
        for name, parent, kind in joints
    )
    (folder / "r.urdf").write_text(f'<robot name="r"><link name="torso"/>{parts}</robot>')
    limits = "lower_%s: 0, upper_%s: 1, velocity_%s_s: 1, acceleration_%s_s2: 1"
    (folder / "robot.yaml").write_text(
        f"schema: 1\nname: r\nurdf: r.urdf\nnodes: [follow_joint_trajectory_server{nodes}]\n"
        "joints:\n"
        f"  - {{name: lift, axis: 0, type: prismatic, {limits.replace('%s', 'm')}}}\n"
        f"  - {{name: elbow, axis: 1, {limits.replace('%s', 'rad')}}}\n"
        f"groups: {groups}\n"
        "gripper: {output_byte: 0, output_bit: 0, joints: [a, b], open_m: 1, closed_m: 0}\n"
    )
    name = "gripper_controller"
    action = f"ros_parameters.{name}.gripper_action={name}/gripper_cmd"
    overrides = [parse_override(action)] if name in nodes else []
    return ExportInput(load_robot_descriptor(folder / "robot.yaml", overrides=overrides))


def test_the_gripper_is_on_a_link_of_its_parent_group(tmp_path: Path) -> None:
    groups = "{lift: {joints: [lift]}, arm: {joints: [elbow]}}"
    files = moveit_package(lifted_gripper(tmp_path, groups))
    effector = etree.fromstring(files["config/r.srdf"].encode()).find("end_effector")
    assert effector is not None
    assert (effector.get("parent_group"), effector.get("parent_link")) == ("arm", "elbow")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("gripper", "groups.gripper: a joint group is named 'gripper', as the planning group of"),
        ("planner_configs", "is named 'planner_configs', as a parameter of the planning pipeline"),
    ],
)
def test_a_joint_group_with_a_name_of_the_configuration_is_rejected(
    name: str, reason: str, tmp_path: Path
) -> None:
    """The SRDF would have two groups of one name, and the parameters one key for two things."""
    source = lifted_gripper(tmp_path, f"{{lift: {{joints: [lift]}}, {name}: {{joints: [elbow]}}}}")
    with pytest.raises(DescriptorError, match=reason):
        moveit_package(source)


def test_an_arm_and_a_gripper_of_one_controller_name_are_rejected(tmp_path: Path) -> None:
    """The trajectories of the arm would have no controller."""
    groups = "{lift: {joints: [lift]}, gripper: {joints: [elbow]}}"
    source = lifted_gripper(tmp_path, groups, ", gripper_controller")
    both = (
        "the actions /gripper_controller/follow_joint_trajectory and"
        " /gripper_controller/gripper_cmd are both of a controller 'gripper_controller'; rename"
    )
    with pytest.raises(DescriptorError, match=both):
        move_group_parameters(source)


def test_every_moving_joint_is_planned_or_passive(package: Package) -> None:
    urdf, srdf = package.urdf, package.srdf
    held = {element.get("name") for element in srdf.iter("joint", "passive_joint")}
    assert held == {joint.name for joint in urdf.joints if joint.moves}


def test_the_home_position_is_within_the_limits_of_the_descriptor() -> None:
    overrides = [
        parse_override("joints.0.lower_rad=0.2"),
        parse_override("joints.1.upper_rad=-0.3"),
    ]
    descriptor = load_robot_descriptor("cr3a", overrides=overrides)
    srdf = moveit_package(ExportInput(descriptor))["config/cr3a.srdf"]
    home = etree.fromstring(srdf.encode()).find("group_state")
    assert home is not None
    values = {element.get("name"): float(element.get("value")) for element in home}
    assert [values[f"joint{number}"] for number in (1, 2, 3)] == [0.2, -0.3, 0.0]


def test_taught_poses_are_named_states(tmp_path: Path) -> None:
    joints = [f"joint{number}" for number in range(1, 7)]
    poses = tmp_path / "poses.yaml"
    write_poses(
        poses,
        {
            "home": dict.fromkeys(joints, 0.25),
            "pick": dict.fromkeys(joints, -0.5),
            "too--far": dict.fromkeys(joints, 0.0) | {"joint2": 9.0},
            "other_arm": {"left": 0.0},
        },
    )
    descriptor = load_robot_descriptor("cr3a", overrides=[parse_override(f"poses={poses}")])
    srdf = moveit_package(ExportInput(descriptor))["config/cr3a.srdf"]
    states = {
        state.get("name"): {joint.get("name"): float(joint.get("value")) for joint in state}
        for state in etree.fromstring(srdf.encode()).iterfind("group_state[@group='arm']")
    }
    assert states == {"home": dict.fromkeys(joints, 0.25), "pick": dict.fromkeys(joints, -0.5)}
    assert "The pose too- -far of arm is beyond the limits of joint2." in srdf


@pytest.mark.parametrize(
    ("robot", "variant"), [("cr3a", "orin"), ("fr3", "hand"), ("panda", "hand")]
)
def test_the_ends_of_the_gripper_are_named_states(robot: str, variant: str) -> None:
    descriptor = load_robot_descriptor(robot, variant)
    assert (gripper := descriptor.gripper)
    root = etree.fromstring(
        moveit_package(ExportInput(descriptor))[f"config/{robot}.srdf"].encode()
    )
    states = {
        state.get("name"): [float(joint.get("value")) for joint in state]
        for state in root.iterfind("group_state[@group='gripper']")
    }
    assert set(states) == {"open", "closed"}
    assert states["open"] == pytest.approx([gripper.open_m] * 2)
    assert states["closed"] == pytest.approx([gripper.closed_m] * 2)
    effector = root.find("end_effector")
    assert effector is not None
    assert effector.get("parent_group") == "arm"


def test_controllers_solvers_and_planners_belong_to_groups(package: Package) -> None:
    groups = {element.get("name") for element in package.srdf.iterfind("group")}
    assert set(package.content("kinematics")) == groups - {"gripper"}
    assert set(package.content("ompl_planning")) >= groups - {"gripper"}
    controllers = package.content("moveit_controllers")["moveit_simple_controller_manager"]
    driven = {
        joint for name in controllers["controller_names"] for joint in controllers[name]["joints"]
    }
    descriptor = package.source.descriptor
    assert driven >= {*descriptor.joint_names}
    limits = package.content("joint_limits")["joint_limits"]
    assert set(limits) == {*descriptor.joint_names}


def test_an_execution_may_take_longer_at_a_lower_speed(package: Package) -> None:
    execution = package.content("moveit_controllers")["trajectory_execution"]
    assert execution["execution_duration_monitoring"] is False


def test_the_launch_file_compiles_and_names_the_package(package: Package) -> None:
    (name,) = [file for file in package.files if file.endswith(".launch.py")]
    compile(package.files[name], name, "exec")
    robot = package.source.descriptor.name
    assert f'package_name="{robot}_moveit_config"' in package.files[name]
    assert f"<name>{robot}_moveit_config</name>" in package.files["package.xml"]


def test_disabled_collisions_never_happen(package: Package) -> None:
    path = package.source.urdf_path()
    covers = collision_covers(read_urdf_text(path), path)
    never = [
        pair for *pair, reason in disabled_collisions(package.urdf, covers) if reason == "Never"
    ]
    assert never
    generator = np.random.default_rng(1)
    moving = [joint for joint in package.urdf.joints if joint.moves]
    for _ in range(SAMPLES // len(never)):
        positions = {
            joint.name: generator.uniform(max(joint.lower, -pi), min(joint.upper, pi))
            for joint in moving
        }
        for first, second in never:
            assert gap(package.urdf, covers, first, second, positions) > 0.0


def gap(
    urdf: UrdfRobot,
    covers: dict[str, Cover],
    first: str,
    second: str,
    positions: dict[str, float],
) -> float:
    """Least distance between the spheres of two links."""
    centers = []
    for link in (first, second):
        pose = urdf.pose(link, positions)
        centers.append(covers[link].centers @ pose[:3, :3].T + pose[:3, 3])
    distance = np.linalg.norm(centers[0][:, np.newaxis] - centers[1], axis=2)
    spheres = distance - covers[first].radii[:, np.newaxis] - covers[second].radii
    return float(spheres.min())


ARM = """<robot name="arm">
<link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<link name="frame"/>
<link name="rod"><collision><origin xyz="0 0 {middle}"/>
  <geometry><cylinder radius="0.02" length="0.1"/></geometry></collision></link>
<link name="tip"><collision><origin xyz="{reach} 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="frame"/>
  <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="hold" type="fixed"><parent link="frame"/><child link="rod"/></joint>
<joint name="swing" type="revolute"><parent link="rod"/><child link="tip"/>
  <origin xyz="0 0 0.1"/><axis xyz="0 1 0"/><limit lower="-2" upper="{upper}" effort="1" velocity="1"/></joint>
</robot>"""  # noqa: E501


@pytest.mark.parametrize(
    ("reach", "upper", "is_apart"),
    [
        (0.3, "2", True),  # too short to reach the base
        (0.5, "2", False),  # swings down to the base, at 1.57 rad
        (0.5, "0.5", True),  # would reach it, beyond its limits
    ],
)
def test_links_are_apart_where_no_position_lets_them_touch(
    tmp_path: Path, reach: float, upper: str, is_apart: bool
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(middle=0.0, reach=reach, upper=upper), encoding="utf-8")
    pairs = {
        (a, b): why
        for a, b, why in disabled_collisions(
            read_urdf(path), collision_covers(path.read_text("utf-8"), path)
        )
    }
    assert pairs[("base", "rod")] == "Adjacent"  # through a link without a shape
    assert pairs[("rod", "tip")] == "Adjacent"
    assert (("base", "tip") in pairs) is is_apart


@pytest.mark.parametrize("is_text", [False, True])
def test_meshes_are_inside_their_spheres(tmp_path: Path, is_text: bool) -> None:
    triangles = np.random.default_rng(2).uniform(-1.0, 1.0, (50, 3, 3)).astype("<f4")
    if is_text:
        corners = "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangles.reshape(-1, 3))
        data = f"solid it\n{corners}endsolid\n".encode()
    else:
        facets = b"".join(bytes(12) + triangle.tobytes() + bytes(2) for triangle in triangles)
        data = bytes(80) + len(triangles).to_bytes(4, "little") + facets
    (tmp_path / "a.stl").write_bytes(data)
    text = (
        '<robot name="it"><link name="a"><collision><geometry>'
        '<mesh filename="a.stl" scale="2 1 0.5"/></geometry></collision></link></robot>'
    )
    cover = collision_covers(text, tmp_path / "it.urdf")["a"]
    assert cover.is_known
    scaled = triangles.reshape(-1, 3) * [2.0, 1.0, 0.5]
    inside = np.linalg.norm(scaled[:, np.newaxis] - cover.centers, axis=2) <= cover.radii + 1e-6
    assert inside.any(axis=1).all()


def test_links_with_meshes_that_are_not_read_are_apart_by_no_proof(tmp_path: Path) -> None:
    mesh = '<mesh filename="a.dae"/>'
    text = ARM.format(middle=0.0, reach=0.3, upper="2").replace('<sphere radius="0.05"/>', mesh)
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    pairs = [
        pair[:2] for pair in disabled_collisions(read_urdf(path), collision_covers(text, path))
    ]
    assert ("base", "tip") not in pairs


def test_the_command_makes_a_folder_and_does_not_write_into_one(tmp_path: Path) -> None:
    arguments = ["export", "moveit_package", "--robot", "cr3a"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2
    assert "is a folder" in result.output
    folder = tmp_path / "made"
    arguments += ["--output", str(folder)]
    assert CliRunner().invoke(main, arguments).exit_code == 0
    assert (folder / "config" / "cr3a.srdf").is_file()
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code != 0
    assert "exists already" in result.output


@pytest.mark.parametrize(
    ("origin", "shape", "reason"),
    [
        ("0 0 0", "<sphere/>", "radius of sphere is '', must be 1 finite number"),
        ("0 0 0", '<cylinder length="1"/>', "radius of cylinder is '', must be 1 finite number"),
        ("0 0 0", '<box size="1 2"/>', "size of box is '1 2', must be 3 finite numbers"),
        ("0 x 0", '<sphere radius="1"/>', "xyz of origin is '0 x 0', must be 3 finite numbers"),
        ("nan 0 0", '<sphere radius="1"/>', "xyz of origin is 'nan 0 0', must be 3 finite"),
    ],
)
def test_a_shape_without_its_numbers_is_named(origin: str, shape: str, reason: str) -> None:
    geometry = f'<origin xyz="{origin}"/><geometry>{shape}</geometry>'
    text = f'<robot name="r"><link name="b"><collision>{geometry}</collision></link></robot>'
    with pytest.raises(DescriptorError, match=f"link 'b': {reason}"):
        collision_covers(text, Path("x.urdf"))
