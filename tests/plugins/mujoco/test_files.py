"""URDF, MJCF and scenes as files: losses are logged, mistakes are errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.plugins.mujoco.cell import cell

from robotd import log
from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import DescriptorError, InvalidArgument

URDF = """<robot name="arm">
  <link name="base"><visual><geometry><mesh filename="package://none/base.dae"/></geometry></visual></link>
  <joint name="j" type="revolute"><parent link="base"/><child link="beam"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
  <link name="beam"/>
  <joint name="fixed" type="fixed"><parent link="beam"/><child link="tool"/></joint>
  <link name="tool"><inertial><mass value="0.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
</robot>
"""
MJCF = """<mujoco><compiler angle="radian"/>
<worldbody><body name="base" pos="0 0 .3"><body name="beam">
  <joint name="j" axis="0 0 1" range="-1 1"/><geom size=".05" mass="1"/>
</body></body></worldbody><actuator><motor joint="j"/></actuator></mujoco>"""
ROBOT = """schema: 1
name: arm
backend: mujoco
{urdf}
joints:
  - {{name: j, axis: 0, lower_rad: -1, upper_rad: 1, velocity_rad_s: 1, acceleration_rad_s2: 5}}
backends:
  mujoco: {{{options}}}
"""
SCENE_XML = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/>
  <body name="ball" pos=".5 0 .05"><freejoint/><geom size=".05" mass=".1"/></body>
</worldbody></mujoco>"""


def robot_file(folder: Path, options: str = "", *, urdf: bool = True) -> str:
    """Write a robot of one joint and its files."""
    (folder / "arm.urdf").write_text(URDF)
    (folder / "arm.xml").write_text(MJCF)
    (folder / "scene.xml").write_text(SCENE_XML)
    text = ROBOT.format(options=options, urdf="urdf: arm.urdf" if urdf else "")
    (folder / "robot.yaml").write_text(text)
    return str(folder / "robot.yaml")


def test_what_the_import_loses_is_told_and_links_stay(tmp_path: Path) -> None:
    lines: list[log.LogLine] = []
    log.add_listener(lines.append)
    try:
        with cell(robot=robot_file(tmp_path), start=False) as arm:
            names = {arm.physics.model.body(number).name for number in range(4)}
    finally:
        log.remove_listener(lines.append)
    assert names == {"world", "base", "beam", "tool"}
    notes = [str(line.fields.get("note", line.text)) for line in lines]
    assert any("base.dae is not found" in note for note in notes)
    assert any("links without mass weigh 1 g: beam" in note for note in notes)


@pytest.mark.parametrize("kind", ["floating", "planar", "revolute"])
def test_a_joint_that_no_axis_moves_is_fixed(kind: str, tmp_path: Path) -> None:
    robot = robot_file(tmp_path)
    loose = f'<joint name="fixed" type="{kind}"><axis xyz="0 0 0"/>'
    (tmp_path / "arm.urdf").write_text(URDF.replace('<joint name="fixed" type="fixed">', loose))
    with cell(robot=robot, start=False) as arm:
        assert arm.physics.model.nv == 1


def test_limits_that_mean_none_make_a_model(tmp_path: Path) -> None:
    robot = robot_file(tmp_path)
    text = URDF.replace('lower="-1"', 'lower="-1.7e308"').replace('upper="1"', 'upper="1.7e308"')
    (tmp_path / "arm.urdf").write_text(text)
    with cell(robot=robot) as arm:
        assert arm.go((0.5,), 1.0).outcome is Outcome.SUCCEEDED


def test_an_mjcf_and_a_scene_in_mjcf_make_a_robot(tmp_path: Path) -> None:
    robot = robot_file(tmp_path, "mjcf: arm.xml, scene: scene.xml", urdf=False)
    with cell(robot=robot) as arm:
        execution = arm.go((0.5,), 1.0)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        assert arm.robot.image.position == pytest.approx([0.5], abs=1e-3)
        # Seen from the root of the robot, which the MJCF puts 0.3 m above the floor.
        assert arm.pose("ball")[:3] == pytest.approx([0.5, 0.0, 0.05 - 0.3], abs=2e-3)


FOREIGN = """<mujoco><compiler angle="radian"/>
<worldbody><body name="base" pos="0 0 .3"><body>
  <joint name="left/waist" axis="0 0 1" range="-1 1"/><geom size=".05" mass="1"/>
</body></body></worldbody>
<actuator><position name="left/motor" joint="left/waist"/></actuator>
<sensor><actuatorfrc actuator="left/motor"/><jointpos joint="left/waist"/></sensor>
<keyframe><key name="home" qpos="0.1" ctrl="0.1"/></keyframe></mujoco>"""


def test_a_foreign_mjcf_keeps_its_names(tmp_path: Path) -> None:
    """Names with a slash, a body without one, and a sensor of an actuator that is left out."""
    robot = robot_file(tmp_path, "mjcf: arm.xml, mjcf_joints: {j: left/waist}", urdf=False)
    (tmp_path / "arm.xml").write_text(FOREIGN)
    with cell(robot=robot) as arm:
        assert arm.go((0.5,), 1.0).outcome is Outcome.SUCCEEDED
        assert arm.physics.data.joint("left/waist").qpos[0] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        ("{j: right/waist}", r"has no joint 'right/waist' \(it has left/waist\)"),
        ("{k: left/waist}", r"mjcf_joints: k: no joint of the robot \(j\)"),
    ],
)
def test_a_joint_that_is_not_there_is_named(tmp_path: Path, names: str, reason: str) -> None:
    robot = robot_file(tmp_path, f"mjcf: arm.xml, mjcf_joints: {names}", urdf=False)
    (tmp_path / "arm.xml").write_text(FOREIGN)
    with pytest.raises(DescriptorError, match=reason), cell(robot=robot):
        pass


def test_a_body_on_a_hinge_cannot_be_placed_and_moves_no_object(tmp_path: Path) -> None:
    robot = robot_file(tmp_path, "mjcf: arm.xml, scene: scene.xml", urdf=False)
    door = """<body name="door" pos="2 0 .5"><joint axis="0 0 1"/><geom size=".1" mass="1"/></body>
      <body name="ball" """
    (tmp_path / "scene.xml").write_text(SCENE_XML.replace('<body name="ball" ', door))
    with cell(robot=robot) as arm:
        world, before = arm.robot.world, arm.pose("ball")
        assert world is not None
        with pytest.raises(InvalidArgument, match="door is fixed"):
            world.place("door", before)
        world.place("ball", np.array([0.5, 0.5, 0.5, 0.0, 0.0, 0.0, 1.0]))
        world.reset()
        arm.robot.step(1)
        assert arm.pose("ball") == pytest.approx(before, abs=1e-4)


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        ("objects: [{name: a, at_m: [0, 0, 0]}]", "needs one of box_m"),
        ("objects: [{name: a, box_m: [1, 1, 0], at_m: [0, 0, 0]}]", "greater than 0"),
        (
            "objects: [{name: a, mesh: no.stl, at_m: [0, 0, 0]}]",
            r"scene.yaml:1: objects.0.mesh: the file does not exist \(value 'no.stl'\)",
        ),
        (
            "objects: [{name: beam, sphere_m: 1, at_m: [0, 0, 0]}]",
            r"scene.yaml:1: objects.0.name: a link, .* has this name \(value 'beam'\)",
        ),
        ("obejcts: []", "scene.yaml:1: obejcts: unknown key; did you mean 'objects'"),
        ("a: [", "scene.yaml:2: not valid YAML: did not find"),
        ("- a", "scene.yaml:1: must be a mapping of keys to values"),
        (
            "objects: [{name: a, sphere_m: 1, at_m: [0, 0, 0], mas_kg: 1}]",
            "scene.yaml:1: objects.0.mas_kg: unknown key; did you mean 'mass_kg'",
        ),
        (
            "floor: true\ncameras:\n- {name: c, at_m: [0, 0, 1],\n   look_at_m: [0, 0], width: 8}",
            r":4: cameras.0.look_at_m.*missing[\s\S]*:4: cameras.0.width: must be .*16 \(value 8\)",
        ),
        (
            "cameras: [{name: c, link: arm9, at_m: [0, 0, 1], look_at_m: [0, 0, 0]}]",
            r"scene.yaml:1: cameras.0.link: unknown link 'arm9' \(available: world, .*beam",
        ),
        ("cameras: [{name: c, at_m: [0, 0, 1], look_at_m: [0, 0, 1]}]", "are the same point"),
        (
            "objects: [{name: floor, sphere_m: 1, at_m: [0, 0, 0]}]",
            r"scene.yaml:1: objects.0.name: .*the floor .* has this name \(value 'floor'\)",
        ),
        (
            "objects: [{name: world, sphere_m: 1, at_m: [0, 0, 0]}]",
            r"scene.yaml:1: objects.0.name: .*the world has this name \(value 'world'\)",
        ),
    ],
)
def test_a_wrong_scene_is_an_error_with_its_reason(scene: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(scene)
    robot = robot_file(tmp_path, "scene: scene.yaml")
    with pytest.raises(DescriptorError, match=reason), cell(robot=robot, start=False):
        pass


def test_a_body_of_a_scene_without_a_name_is_an_error(tmp_path: Path) -> None:
    robot = robot_file(tmp_path, "mjcf: arm.xml, scene: scene.xml", urdf=False)
    (tmp_path / "scene.xml").write_text(SCENE_XML.replace('name="ball"', ""))
    with (
        pytest.raises(DescriptorError, match="scene has no name"),
        cell(robot=robot, start=False),
    ):
        pass


def test_a_file_that_does_not_exist_is_an_error(tmp_path: Path) -> None:
    robot = robot_file(tmp_path, "scene: none.yaml, initial_position_rad: [1, 2]")
    both = r"none.yaml does not exist[\s\S]*2 positions"
    with pytest.raises(DescriptorError, match=both), cell(robot=robot, start=False):
        pass
