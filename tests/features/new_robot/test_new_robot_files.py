"""``robotd new-robot``: SRDF files and meshes, and folders that are whole or not there."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest
from tests.command_line import Robotd
from tests.features.new_robot.test_new_robot_kinds import joint

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.descriptor.urdf import read_urdf_text

ARM = "".join(
    joint(f"{side}_j{n}", f"{side}_l{n - 1}" if n > 1 else "torso", f"{side}_l{n}")
    for side in ("a", "b")
    for n in (1, 2, 3)
)
TORSO = joint("lift", "base", "torso") + ARM
GROUPS = """
<group name="right arm"><chain base_link="torso" tip_link="a_l3"/></group>
<group name="left"><joint name="b_j1"/><joint name="b_j2"/><link name="b_l3"/></group>
<group name="both"><group name="right arm"/><group name="left"/></group>
<group name="left_and_torso"><chain base_link="base" tip_link="b_l3"/></group>
<group name="wrist"><joint name="a_j3"/></group>
"""


class Robots:
    """Makes the robot ``it`` of a URDF in the folder ``made``."""

    def __init__(self, robotd: Robotd, folder: Path) -> None:
        self._robotd, self.folder = robotd, folder
        self.made = folder / "made" / "it"

    def make(self, body: str, *options: str) -> tuple[RobotDescriptor, str]:
        text = f'<robot name="it"><link name="base"/>\n{body}</robot>'
        (self.folder / "it.urdf").write_text(text, encoding="utf-8")
        status, output = self.run(*options)
        assert status == 0, output
        return load_robot_descriptor(self.made), output

    def run(self, *options: str) -> tuple[int, str]:
        urdf = str(self.folder / "it.urdf")
        into = str(self.made.parent)
        result = self._robotd("new-robot", "it", "--urdf", urdf, "--into", into, *options)
        return result.exit_code, result.output

    def srdf(self, text: str) -> str:
        path = self.folder / "it.srdf"
        path.write_text(f'<robot name="it">{text}</robot>', encoding="utf-8")
        return str(path)


@pytest.fixture
def robots(robotd: Robotd, tmp_path: Path) -> Robots:
    return Robots(robotd, tmp_path)


def groups(robot: RobotDescriptor) -> dict[str, tuple[str, ...]]:
    return {name: group.joints for name, group in robot.groups.items()}


def test_groups_have_the_names_of_an_srdf(robots: Robots) -> None:
    robot, _ = robots.make(TORSO, "--srdf", robots.srdf(GROUPS))
    assert groups(robot) == {
        "right_arm": ("a_j1", "a_j2", "a_j3"),
        "left": ("b_j1", "b_j2", "b_j3"),
        "torso": ("lift",),
    }


def test_joints_that_an_srdf_calls_passive_get_no_axis(robots: Robots) -> None:
    srdf = robots.srdf(GROUPS + '<passive_joint name="b_j3"/>')
    robot, _ = robots.make(TORSO, "--srdf", srdf)
    assert "b_j3" not in robot.joint_names
    assert groups(robot)["left"] == ("b_j1", "b_j2")


def test_an_srdf_of_another_robot_is_rejected(robots: Robots) -> None:
    robots.make(TORSO)
    srdf = robots.srdf('<group name="arm"><joint name="panda_joint1"/></group>')
    robots.made.rename(robots.folder / "before")
    status, output = robots.run("--srdf", srdf)
    assert status != 0
    assert "no group has a joint of the URDF of it" in output
    assert not robots.made.exists()


def test_groups_of_joints_with_numbers_have_the_names_of_their_last_links(robots: Robots) -> None:
    chain = "".join(
        joint(f"j{n}", f"l-{n - 1}" if n not in (1, 4) else "base", f"l-{n}") for n in range(1, 7)
    )
    robot, _ = robots.make(chain)
    assert groups(robot) == {"l_3": ("j1", "j2", "j3"), "l_6": ("j4", "j5", "j6")}


class TestMeshes:
    LINK = (
        '<link name="tool"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'
        '<joint name="flange" type="fixed"><parent link="a"/><child link="tool"/></joint>'
    )

    def body(self, *names: str) -> str:
        links = "".join(
            self.LINK.format(name).replace("tool", f"t{n}").replace("flange", f"f{n}")
            for n, name in enumerate(names)
        )
        return joint("j", "base", "a") + links

    def test_those_beside_the_urdf_are_found_from_the_robot(self, robots: Robots) -> None:
        (robots.folder / "it_description").mkdir()
        (robots.folder / "it_description" / "a b.stl").write_bytes(bytes(2**20))
        (robots.folder / "c.stl").write_bytes(bytes(2**20))
        body = self.body("package://it_description/a%20b.stl", "c.stl", "gone.stl")
        _, output = robots.make(body)
        assert "2 meshes left in place, 2.0 MiB; --copy-meshes copies them; 1 mesh not" in output
        assert "1 of 3 meshes not found (gone.stl)" in output

    def test_they_are_copied_on_request(self, robots: Robots) -> None:
        for folder in ("visual", "collision", "visual/parts"):
            (robots.folder / folder).mkdir()
        (robots.folder / "visual" / "a.stl").write_bytes(b"visual")
        (robots.folder / "collision" / "a.stl").write_bytes(b"collision")
        gltf = '{"buffers": [{"uri": "parts/b.bin"}]}'
        (robots.folder / "visual" / "b.gltf").write_text(gltf, encoding="utf-8")
        (robots.folder / "visual" / "parts" / "b.bin").write_bytes(b"parts")
        names = ("visual/a.stl", "collision/a.stl", "visual/b.gltf")
        _, output = robots.make(self.body(*names), "--copy-meshes")
        assert "3 meshes copied, 0.0 MiB" in output
        assert "not found" not in output
        text = read_urdf_text(robots.made / "it.urdf")
        for name, content in (("a.stl", b"visual"), ("2_a.stl", b"collision")):
            assert f'"meshes/{name}"' in text
            assert (robots.made / "meshes" / name).read_bytes() == content
        assert (robots.made / "meshes" / "b" / "parts" / "b.bin").read_bytes() == b"parts"

    def test_a_folder_is_searched_for_them(self, robots: Robots) -> None:
        folder = robots.folder / "elsewhere"
        (folder / "deep").mkdir(parents=True)
        (folder / "deep" / "a.stl").write_bytes(b"a")
        _, output = robots.make(self.body("package://x/deep/a.stl"), "--meshes", str(folder))
        assert "not found" not in output


@pytest.mark.parametrize("options", [(), ("--package",)])
def test_a_robot_is_written_whole_or_not_at_all(
    robots: Robots, options: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    robots.make(joint("j", "base", "a"))
    robots.made.rename(robots.folder / "before")
    robots.made.parent.rmdir()
    write = Path.write_bytes

    def full(path: Path, data: bytes) -> int:
        if path.suffix == ".urdf":
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        status, output = robots.run(*options)
    assert status != 0
    assert "cannot be written, nothing is left of it: No space left on device" in output
    assert not robots.made.parent.exists()
    status, output = robots.run(*options)
    assert status == 0, output
