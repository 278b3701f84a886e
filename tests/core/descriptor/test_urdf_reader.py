"""URDF files: a tree with limits, or every problem with its element and line."""

import re
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from robotd.descriptor.urdf import parse_urdf, read_urdf, read_urdf_text
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


def soft(lower: object, upper: object) -> str:
    return (
        f'<safety_controller k_velocity="1" soft_lower_limit="{lower}" soft_upper_limit="{upper}"/>'
    )


def problems(body: str) -> list[str]:
    with pytest.raises(DescriptorError) as error:
        parse_urdf(f'<robot name="arm">\n{body}</robot>\n'.encode(), PATH)
    return str(error.value).splitlines()


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        (joint("a", "base", "tip", LIMIT.replace('"2"', '"nan"')) + links("base", "tip"),
         "arm.urdf:2: a: velocity='nan' is not a finite number"),
        (joint("a", "base", "tip", LIMIT + '<origin xyz="0 0"/>') + links("base", "tip"),
         "arm.urdf:2: a: xyz='0 0' is not three finite numbers"),
        (joint("a", "base", "tip", LIMIT + '<origin rpy="0 inf 0"/>') + links("base", "tip"),
         "arm.urdf:2: a: rpy='0 inf 0' is not three finite numbers"),
        (joint("a", "base", "tip", LIMIT + '<origin xyz="$(x)"/>') + links("base", "tip"),
         "arm.urdf:2: a: xyz='$(x)' is not three finite numbers, but a value that xacro"),
        (joint("a", "base", "tip", LIMIT + '<mimic joint="a"/>') + links("base", "tip"),
         "arm.urdf:2: a: mimics itself: a → a"),
        (joint("a", "base", "tipp") + links("base", "tip"),
         "arm.urdf:2: a: child link 'tipp' does not exist; did you mean 'tip'?"),
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
         "arm.urdf:5: island: link is a second root, besides 'base': no joint connects it"),
        ("", "arm.urdf:1: has no link"),
        (joint("a", "base", "tip", LIMIT.replace('"2"', '"1_0"')) + links("base", "tip"),
         "arm.urdf:2: a: velocity='1_0' is not a finite number"),
        (joint("a", "base", "tip", LIMIT.replace('"2"', '"١"')) + links("base", "tip"),
         "arm.urdf:2: a: velocity='١' is not a finite number"),
        (joint("a", "base", "tip", LIMIT.replace('"2"', '"1e999"')) + links("base", "tip"),
         "arm.urdf:2: a: velocity='1e999' is not a finite number"),
        (joint("a", "base", "tip", LIMIT + '<origin xyz="0 1_0 0"/>') + links("base", "tip"),
         "arm.urdf:2: a: xyz='0 1_0 0' is not three finite numbers"),
        (joint("a", "base", "tip", LIMIT + soft(2, 3)) + links("base", "tip"),
         "arm.urdf:2: a: soft limits 2 to 3 leave nothing of -1 to 1"),
        (joint("a", "base", "tip", LIMIT + soft("x", 3)) + links("base", "tip"),
         "arm.urdf:2: a: soft_lower_limit='x' is not a finite number"),
    ],
)  # fmt: skip
def test_a_problem_names_element_and_line(body: str, problem: str) -> None:
    found = problems(body)
    assert len(found) == 1
    assert found[0].startswith(problem)


def test_all_problems_come_at_once_in_the_order_of_the_file() -> None:
    found = problems(
        joint("a", "base", "arm", '<limit effort="x"/>')
        + joint("b", "arm", "tip", LIMIT.replace('"5"', '"much"'))
        + joint("c", "tipp", "end")
        + links("base", "arm", "tip")
    )
    lines = [int(re.findall(r":(\d+):", text)[0]) for text in found]
    assert lines == [2, 3, 4, 4]


@pytest.mark.parametrize("digits", ["9" * 300_000, "9" * 300_000 + ".", "." + "9" * 300_000])
def test_a_long_number_takes_no_longer_than_its_text(digits: str) -> None:
    """With a choice of parts for each digit it would take hours."""
    limit = f'<limit lower="0" upper="1" velocity="{digits}x"/>'
    text = f'<robot name="arm"><joint name="j" type="revolute">{limit}</joint></robot>'
    with pytest.raises(DescriptorError, match="is not a finite number"):
        parse_urdf(text.encode(), Path("arm.urdf"))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("<robot>", "arm.urdf:1: not XML: "),
        ("", "arm.urdf:1: not XML: Document is empty"),
        ("\0", "arm.urdf:1: not XML: Document is empty"),
        ('<sdf version="1.6"/>', "arm.urdf:1: begins with <sdf>, not <robot>: no URDF"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro">\n<xacro:arm/></robot>',
         "arm.urdf:1: is xacro, not URDF: pass it to 'robotd new-robot --urdf'"),
    ],
)  # fmt: skip
def test_other_files_are_named(text: str, problem: str) -> None:
    with pytest.raises(DescriptorError, match=re.escape(problem)):
        parse_urdf(text.encode(), PATH)


@pytest.mark.parametrize(
    "inside",
    [
        '<axis xyz="0 0 0"/>',
        '<limit lower="0" upper="0" effort="0" velocity="0"/>',
        '<limit lower="1" upper="-1" effort="-1" velocity="x"/><mimic joint="none"/>',
    ],
)
def test_a_fixed_joint_says_nothing_about_motion(inside: str) -> None:
    body = joint("a", "base", "tip", inside, kind="fixed") + links("base", "tip")
    found = parse_urdf(f"<robot>{body}</robot>", PATH).joint["a"]
    assert not found.moves
    assert (found.velocity, found.effort, found.mimic) == (None, None, None)


@pytest.mark.parametrize(
    ("safety", "limits"),
    [
        ("", (-1.0, 1.0)),
        (soft(-0.5, 0.8), (-0.5, 0.8)),
        (soft(-0.5, 3), (-0.5, 1.0)),
        (soft(-4, 4), (-1.0, 1.0)),
        (soft(0, 0), (-1.0, 1.0)),  # as urdfdom reads absent ones
        ('<safety_controller k_velocity="10"/>', (-1.0, 1.0)),
        ('<safety_controller k_velocity="10" soft_upper_limit="0.5"/>', (-1.0, 0.5)),
    ],
)
def test_the_tighter_of_hard_and_soft_limits_applies(
    safety: str, limits: tuple[float, float]
) -> None:
    body = joint("a", "base", "tip", LIMIT + safety) + links("base", "tip")
    found = parse_urdf(f"<robot>{body}</robot>", PATH).joint["a"]
    assert (found.lower, found.upper) == limits


def test_a_velocity_of_0_is_none() -> None:
    body = joint("a", "base", "tip", LIMIT.replace('"2"', '"0.0"')) + links("base", "tip")
    assert parse_urdf(f"<robot>{body}</robot>", PATH).joint["a"].velocity is None


@pytest.mark.parametrize("number", ["2", " 2.0 ", "+2.", ".2e1", "2E+0"])
def test_numbers_are_read_as_urdfdom_reads_them(number: str) -> None:
    body = joint("a", "base", "tip", LIMIT.replace('"2"', f'"{number}"')) + links("base", "tip")
    assert parse_urdf(f"<robot>{body}</robot>", PATH).joint["a"].velocity == 2.0


KAEFER = "<robot name='Käfer'><link name='base'/>"
ENCODINGS = [
    ("utf-8", "UTF-8"),
    ("utf-8-sig", ""),
    ("iso-8859-1", "ISO-8859-1"),
    ("utf-16", "UTF-16"),
    ("utf-16", ""),
    ("cp1252", "windows-1252"),
]


@pytest.mark.parametrize(("codec", "declared"), ENCODINGS)
def test_text_and_model_are_read_by_mark_and_declaration(
    tmp_path: Path, codec: str, declared: str
) -> None:
    declaration = f"<?xml version='1.0' encoding='{declared}'?>\n" if declared else ""
    body = joint("a", "base", "Größe") + links("base", "Größe")
    path = tmp_path / "arm.urdf"
    path.write_bytes(f"{declaration}<robot name='Käfer'>\n{body}</robot>".encode(codec))
    assert read_urdf(path).name == "Käfer"
    text = read_urdf_text(path)
    assert text.startswith("<?xml version='1.0' encoding='UTF-8'?>\n" if declared else "<robot")
    assert parse_urdf(text, path).joint["a"].child == "Größe"
    assert parse_urdf(text.encode(), path).name == "Käfer"


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        ("<robot/>".encode("utf-16") + b"\0", "is not UTF-16: "),
        (b"<?xml version='1.0' encoding='klingon'?><robot/>", "klingon"),
        ("<robot/".encode("utf-16"), "not XML: "),
    ],
)
def test_text_that_cannot_be_decoded_is_named(tmp_path: Path, data: bytes, problem: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_bytes(data)
    for read in (read_urdf, read_urdf_text):
        with pytest.raises(DescriptorError, match=problem):
            read(path)


@pytest.mark.parametrize(
    "data",
    [
        f"{KAEFER}</robot>".encode("latin-1"),
        f"<?xml version='1.0' encoding='UTF-8'?>{KAEFER}</robot>".encode("latin-1"),
        f"<?xml version='1.0' encoding='us-ascii'?>{KAEFER}</robot>".encode(),
        f"<?xml version='1.0' encoding='utf-16'?>{KAEFER}</robot>".encode(),
        f"{KAEFER}</robot>".encode("utf-16-le"),
        f"\n <?xml version='1.0'?>{KAEFER}</robot>".encode(),
        f"{KAEFER}<sensor:camera/></robot>".encode(),
        f"<?xml version='0.0' ?>\n{KAEFER}</robot>\0".encode(),
        f"<?xml version='utf-8'?>\n{KAEFER}</robot>".encode(),
        f"<!------ old -- new ----->{KAEFER}<gazebo>a & b</gazebo><sensor:x/></robot>".encode(),
    ],
)
def test_what_urdfdom_reads_is_read_everywhere_the_same(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "arm.urdf"
    path.write_bytes(data)
    assert read_urdf(path).name == "Käfer"
    assert etree.fromstring(read_urdf_text(path).encode()).get("name") == "Käfer"


@pytest.mark.parametrize(
    ("kind", "limit", "note"),
    [
        ("revolute", LIMIT + '<mimic joint="b"/>', "joint a mimics joint 'b', which is none"),
        ("floating", "", "joint a is floating: no axis moves it, its link stays at the origin"),
        ("planar", "", "joint a is planar: no axis moves it, its link stays at the origin"),
        ("revolute", "", "joint a has no <limit>: RViz and MoveIt refuse the file"),
        ("revolute", '<limit lower="0" upper="1"/>', "joint a has no velocity: RViz and MoveIt"),
        ("revolute", LIMIT + "<dynamics/>", "joint a has a <dynamics> without damping or friction"),
    ],
)
def test_what_others_refuse_or_move_is_noted(kind: str, limit: str, note: str) -> None:
    body = joint("a", "base", "tip", limit, kind=kind) + links("base", "tip")
    found = parse_urdf(f"<robot name='r'>{body}</robot>", PATH)
    assert found.notes[0].startswith(note)
    assert found.joint["a"].moves == (kind == "revolute")
    assert found.joint["a"].has_range == bool(limit)


def test_joints_with_the_same_lack_are_noted_in_one_line() -> None:
    limit = '<limit lower="0" upper="1" velocity="1"/>'
    body = joint("a", "base", "b", limit) + joint("c", "b", "d", limit) + links("base", "b", "d")
    found = parse_urdf(f"<robot name='r'>{body}</robot>", PATH)
    assert found.notes == ("joint a and 1 more have no effort: RViz and MoveIt refuse the file",)


@pytest.mark.parametrize(
    ("inside", "note"),
    [
        ('<inertial><mass value="x"/></inertial>', "link tip: <inertial> on line 1 has numbers"),
        ('<visual><geometry><sphere radius="x"/></geometry></visual>', "link tip: radius='x' is"),
    ],
)
def test_a_link_is_read_without_the_part_that_urdfdom_drops(inside: str, note: str) -> None:
    body = joint("a", "base", "tip").strip() + f'<link name="tip">{inside}</link>' + links("base")
    found = parse_urdf(f"<robot name='r'>{body}</robot>", PATH)
    assert found.notes[0].startswith(note)
    assert (found.links["tip"].mass, found.links["tip"].radius) == (None, None)


def test_a_joint_whose_axis_has_no_direction_is_fixed() -> None:
    body = joint("a", "base", "tip", LIMIT + '<axis xyz="0 0 0"/>') + links("base", "tip")
    found = parse_urdf(f"<robot name='r'>{body}</robot>", PATH)
    assert not found.joint["a"].moves
    assert found.notes == ("joint a has the axis 0 0 0: it is read as fixed",)


def test_limits_without_a_range_are_read() -> None:
    zero = '<limit lower="0" upper="0" effort="1" velocity="1"/>'
    body = joint("a", "base", "tip", zero) + links("base", "tip")
    assert not parse_urdf(f"<robot>{body}</robot>", PATH).joint["a"].has_range


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


@pytest.mark.parametrize(
    ("limits", "noted"),
    [
        ('lower="-90" upper="90"', True),
        ('lower="0" upper="45"', True),
        ('lower="-12.57" upper="12.57"', False),
        ('lower="-1e4" upper="1e4"', False),  # a wheel
    ],
)
def test_limits_in_degrees_are_noted(limits: str, noted: bool) -> None:
    text = f"""<robot name="arm"><link name="a"/><link name="b"/>
      <joint name="j" type="revolute"><parent link="a"/><child link="b"/>
      <limit {limits} effort="1" velocity="1"/></joint></robot>"""
    notes = parse_urdf(text, PATH).notes
    assert any("if they are degrees, correct the URDF" in note for note in notes) == noted


def test_a_speed_and_an_effort_below_0_are_none() -> None:
    limit = LIMIT.replace('"2"', '"-1.0"').replace('effort="5"', 'effort="-1.0"')
    body = joint("a", "base", "tip", limit) + links("base", "tip")
    urdf = parse_urdf(f'<robot name="arm">{body}</robot>', PATH)
    assert (urdf.joint["a"].velocity, urdf.joint["a"].effort) == (None, None)
    assert "joint a: velocity=-1 is below 0 and read as none" in urdf.notes
