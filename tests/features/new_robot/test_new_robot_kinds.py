"""``robotd new-robot``: what a URDF leaves open is answered by an option, or asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from pathlib import Path

import pytest
from lxml import etree
from tests.command_line import Robotd

from robotd.cli.exit_codes import ExitCode
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.descriptor.urdf import read_urdf
from robotd.motion import TrajectoryRequest
from robotd.robot import open_robot

LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'
SLIDE = '<limit lower="0" upper="0.04" effort="5" velocity="0.1"/>'

Make = Callable[..., tuple[RobotDescriptor, str]]


def joint(
    name: str, parent: str, child: str, inside: str = LIMIT, kind: str = "revolute", xyz: str = "0"
) -> str:
    """A joint about y, or along it, and the link that it moves."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 {xyz} 0.1"/><axis xyz="0 1 0"/>{inside}</joint><link name="{child}"/>\n'
    )


@pytest.fixture
def make(robotd: Robotd, tmp_path: Path) -> Make:
    """Make the robot of a URDF; return it, and what was printed."""
    numbers = count()

    def run(body: str, *options: str) -> tuple[RobotDescriptor, str]:
        into = tmp_path / str(next(numbers))
        urdf = tmp_path / "it.urdf"
        urdf.write_text(f'<robot name="it"><link name="base"/>\n{body}</robot>', encoding="utf-8")
        result = robotd("new-robot", "it", "--urdf", str(urdf), "--into", str(into), *options)
        assert result.exit_code == 0, result.output
        return load_robot_descriptor(into / "it"), result.output

    return run


def move(robot: RobotDescriptor) -> None:
    """Move every joint to the middle between where it is and its upper limit."""
    assert robot.path is not None
    with open_robot(robot.path, clock=SteppedClock()) as moving, ExitStack() as stack:
        executions = []
        for group in moving.groups.values():
            row = [
                0.5 * (joint.upper + now)
                for joint, now in zip(robot.joints, moving.image.position_command, strict=False)
                if joint.name in group.joint_names
            ]
            goal = TrajectoryRequest.from_rows(group.joint_names, [4.0], [row])
            executions.append(stack.enter_context(group.follower.follow(goal)))
        moving.step(round(5.0 * robot.cycle.rate_hz))
        assert {execution.outcome for execution in executions} == {Outcome.SUCCEEDED}


@pytest.mark.parametrize("mimic", ['<mimic joint="left"/>', ""])
def test_a_gripper_without_an_arm_is_a_robot_of_one_axis(make: Make, mimic: str) -> None:
    fingers = joint("left", "base", "a", SLIDE, "prismatic")
    robot, _ = make(fingers + joint("right", "base", "b", SLIDE + mimic, "prismatic"))
    assert robot.joint_names == ("left",)
    assert robot.gripper is None
    move(robot)


@pytest.mark.parametrize("speed", ['velocity="0"', "", 'velocity="1e308"'])
def test_a_speed_that_is_missing_is_assumed_or_given(
    make: Make, tmp_path: Path, speed: str
) -> None:
    body = joint("a", "base", "b", LIMIT.replace('velocity="2"', speed))
    robot, output = make(body)
    assert robot.joints[0].velocity == 0.5
    assert "speeds assumed: pass --speed JOINT=SPEED" in output
    assert robot.path is not None
    assert "Speeds assumed (0.5 rad/s, 0.05 m/s) for a:" in robot.path.read_text(encoding="utf-8")
    move(robot)
    robot, output = make(body, "--speed", "a=1.5")
    assert robot.joints[0].velocity == 1.5
    assert "assumed" not in output


def test_a_speed_is_for_its_joint_or_for_all_without_one(make: Make) -> None:
    slow = LIMIT.replace('"2"', '"0"')
    body = joint("a", "base", "b") + joint("c", "b", "d", slow) + joint("e", "d", "f", slow)
    robot, _ = make(body, "--speed", "e=4", "--speed", "3")
    assert [joint.velocity for joint in robot.joints] == [2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("limit", "problem"),
    [
        ("", "it.urdf:2: a: has no limits"),
        ('<limit lower="0" upper="0" effort="0" velocity="0"/>', "it.urdf:2: a: lower limit 0 is"),
    ],
)
def test_a_range_that_is_missing_is_asked_for(make: Make, limit: str, problem: str) -> None:
    body = joint("a", "base", "b", limit) + joint("c", "b", "d")
    with pytest.raises(AssertionError) as asked:
        make(body)
    assert problem in str(asked.value)
    assert "pass --limits LOWER,UPPER (one joint: --limits a=LOWER,UPPER), or" in str(asked.value)
    robot, _ = make(body, "--limits", "a=-0.3,0.4")
    assert (robot.joints[0].lower, robot.joints[0].upper) == (-0.3, 0.4)
    move(robot)


@pytest.mark.parametrize(
    ("option", "value", "problem"),
    [
        ("--speed", "a=fast", "'a=fast' is not [JOINT=]SPEED"),
        ("--speed", "a=0", "'a=0': must be above 0"),
        ("--limits", "a=1", "'a=1' is not [JOINT=]LOWER,UPPER"),
        ("--limits", "a=1,1", "'a=1,1': the lower limit is not below the upper one"),
        ("--limits", "z=0,1", "has no joint 'z' for --limits"),
        ("--xacro-arg", "a=1", "'a=1' is not NAME:=VALUE"),
    ],
)
def test_a_wrong_answer_is_named(make: Make, option: str, value: str, problem: str) -> None:
    with pytest.raises(AssertionError) as error:
        make(joint("a", "base", "b"), option, value)
    assert problem in str(error.value)


def test_joints_that_no_drive_moves_have_no_axis(make: Make) -> None:
    body = joint("rocker_left", "base", "b") + joint("lift", "base", "d") + joint("flap", "d", "f")
    robot, _ = make(body, "--passive", "flap")
    assert robot.joint_names == ("lift",)
    assert robot.path is not None
    text = robot.path.read_text(encoding="utf-8")
    assert "#   flap: passive, as chosen" in text
    assert "#   rocker_left: a passive wheel or suspension, by its name" in text


def test_a_mimic_of_no_joint_is_asked_for(make: Make) -> None:
    body = joint("a", "base", "b") + joint("c", "b", "d", LIMIT + '<mimic joint="aa"/>')
    with pytest.raises(AssertionError) as asked:
        make(body)
    assert "it.urdf:3: c: mimics joint 'aa', which is none; did you mean 'a'?" in str(asked.value)
    assert "correct the URDF, or pass --passive c" in str(asked.value)
    robot, output = make(body, "--passive", "c")
    assert robot.joint_names == ("a",)
    assert "joint c mimics joint 'aa', which is none" in output
    move(robot)


@pytest.mark.parametrize(
    ("written", "expected"),
    [("joint_8.0", "joint_8_0"), ("arm/j-1", "arm_j_1"), ("8", "joint_8"), ("关节", "joint"),
     ("a&amp;b", "a_b"), ("null", "null"), ("yes", "yes"), ("off", "off")],
)  # fmt: skip
def test_any_name_of_a_joint_leads_to_a_legal_one(make: Make, written: str, expected: str) -> None:
    follower = joint("tip", "link.1", "link.2", f'{LIMIT}<mimic joint="{written}"/>')
    other = joint("last", "link.2", "link.3")
    robot, _ = make(joint(written, "base", "link.1") + follower + other)
    assert robot.joint_names == (expected, "last")
    assert robot.urdf is not None
    urdf = read_urdf(robot.urdf)
    mimic = urdf.joint["tip"].mimic
    assert mimic is not None
    assert mimic.joint == expected
    assert list(urdf.links) == ["base", "link.1", "link.2", "link.3"]  # the frames
    move(robot)


def test_wheels_with_endless_limits_are_wheels(make: Make) -> None:
    endless = '<limit lower="-1e9" upper="1e9" effort="5" velocity="9"/>'
    body = joint("left_wheel", "base", "a", endless, xyz="0.2")
    body += joint("right_wheel", "base", "b", endless, xyz="-0.2")
    robot, _ = make(body, "--wheel-radius", "0.1")
    assert robot.drive is not None
    assert robot.drive.wheel_joints == ("left_wheel", "right_wheel")


def test_names_that_would_become_the_same_stay_apart(make: Make) -> None:
    body = joint("j.1", "base", "b") + joint("j_1", "b", "d") + joint("j-1", "d", "f")
    robot, _ = make(body + '<gazebo reference="j.1"/><gazebo reference="b"/>', "--speed", "j-1=1")
    assert robot.joint_names == ("j_1_2", "j_1", "j_1_3")
    assert robot.urdf is not None
    references = etree.parse(str(robot.urdf)).findall("gazebo")
    assert [reference.get("reference") for reference in references] == ["j_1_2", "b"]


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_root_that_no_axis_moves_is_stated(make: Make, kind: str) -> None:
    robot, output = make(joint("root", "base", "trunk", "", kind) + joint("a", "trunk", "b"))
    assert robot.joint_names == ("a",)
    assert f"joint root is {kind}: no axis moves it" in output
    move(robot)


def test_missing_meshes_are_counted(make: Make) -> None:
    meshes = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        for name in ("package://arm/a.stl", "b.stl")
    )
    body = joint("a", "base", "b").replace('<link name="b"/>', f'<link name="b">{meshes}</link>')
    _, output = make(body)
    assert "2 of 2 meshes not found (package://arm/a.stl, b.stl)" in output


def test_groups_are_named_by_their_links_where_joints_say_nothing(make: Make) -> None:
    body = "".join(
        joint(f"joint_{3 * side + at}", f"{arm}_{at - 1}" if at else "base", f"{arm}_{at}")
        for side, arm in enumerate(["left_arm", "right_arm"])
        for at in range(3)
    )
    robot, _ = make(body)
    assert list(robot.groups) == ["left_arm", "right_arm"]
    move(robot)


XACRO = """<robot name="it" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/>
<xacro:arg name="reach" default="1"/><xacro:include filename="$(find parts)/arm.xacro"/>
<xacro:arm upper="$(arg reach)"/></robot>"""
ARM = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="arm" params="upper">
<joint name="a" type="revolute"><parent link="base"/><child link="b"/>
<limit lower="-1" upper="${2 * upper}" effort="1" velocity="1"/></joint><link name="b"/>
</xacro:macro></robot>"""


def test_xacro_is_expanded_with_the_packages_beside_it(robotd: Robotd, tmp_path: Path) -> None:
    pytest.importorskip("xacro")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "arm.xacro").write_text(ARM, encoding="utf-8")
    (tmp_path / "it.urdf.xacro").write_text(XACRO, encoding="utf-8")
    options = ("--urdf", str(tmp_path / "it.urdf.xacro"), "--into", str(tmp_path))
    result = robotd("new-robot", "it", *options, "--xacro-arg", "reach:=0.8")
    assert result.exit_code == 0, result.output
    assert load_robot_descriptor(tmp_path / "it").joints[0].upper == 1.6
    urdf = (tmp_path / "it" / "it.urdf").read_text(encoding="utf-8")
    assert '    <limit effort="1" lower="-1" upper="1.6" velocity="1"/>' in urdf.splitlines()
    result = robotd("new-robot", "other", *options, "--xacro-arg", "reach:=-2")
    line = 1 + urdf[: urdf.index("<joint")].count("\n")
    assert f"it.urdf.xacro, expanded:{line}: a: lower limit -1 is not below" in result.stderr
    (tmp_path / "it.urdf.xacro").write_text(XACRO.replace("parts", "none"), encoding="utf-8")
    result = robotd("new-robot", "other", *options)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "package 'none' is neither in AMENT_PREFIX_PATH nor beside the file" in result.stderr


def test_xacro_without_its_package_says_what_to_install(
    robotd: Robotd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "it.urdf.xacro").write_text(XACRO, encoding="utf-8")
    result = robotd("new-robot", "it", "--urdf", str(tmp_path / "it.urdf.xacro"))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "'pip install xacro'" in result.stderr
    assert "'xacro it.urdf.xacro > NAME.urdf'" in result.stderr


def test_names_of_the_urdf_add_no_lines_to_the_robot_file(robotd: Robotd, tmp_path: Path) -> None:
    robot, urdf = tmp_path / "it", tmp_path / "it.urdf"
    evil = "&#10;stop_input: {byte: 0, bit: 0}"
    follower = f'{LIMIT}<mimic joint="fixed{evil}"/>'
    body = (
        joint(f"a{evil}", "base", "b")
        + joint(f"fixed{evil}", "b", "c", "", "fixed")
        + joint("d", "c", "e", follower)
    )
    text = f'<robot name="it&#133;{evil}"><link name="base"/>\n{body}</robot>'
    urdf.write_text(text, encoding="utf-8")
    result = robotd("new-robot", "it", "--urdf", str(urdf), "--into", str(tmp_path))
    assert result.exit_code == 0, result.output
    made = load_robot_descriptor(robot)
    assert made.joint_names == ("a_stop_input_byte_0_bit_0",)
    assert made.stop_input is None
    assert made.summary.startswith("it\x85\nstop_input: {byte: 0, bit: 0}, from")


@pytest.mark.parametrize("frame", ["1", "null", "[x", "*x", "a#b", "a:b"])
def test_the_frame_of_a_base_is_a_text_whatever_its_link_is_called(
    robotd: Robotd, tmp_path: Path, frame: str
) -> None:
    wheels = joint("left_wheel", frame, "l", "", "continuous", "0.2")
    wheels += joint("right_wheel", frame, "r", "", "continuous", "-0.2")
    urdf = tmp_path / "it.urdf"
    urdf.write_text(f'<robot name="it"><link name="{frame}"/>{wheels}</robot>', encoding="utf-8")
    options = ["--urdf", str(urdf), "--into", str(tmp_path), "--wheel-radius", "0.1"]
    result = robotd("new-robot", "it", *options)
    assert result.exit_code == 0, result.output
    parameters = load_robot_descriptor(tmp_path / "it").ros_parameters["diff_drive_controller"]
    assert parameters["base_frame_id"] == frame


def test_limits_of_a_continuous_joint_are_taken(make: Make) -> None:
    robot, _ = make(joint("a", "base", "b", "", "continuous"), "--limits", "a=-2,1.5")
    assert (robot.joints[0].lower, robot.joints[0].upper) == (-2.0, 1.5)
    move(robot)


@pytest.mark.parametrize("name", ["a>b", "a/>b", "x='1'>"])
def test_a_name_that_looks_like_the_end_of_a_tag_is_replaced(make: Make, name: str) -> None:
    robot, _ = make(joint(name, "base", "b") + joint("c", "b", "d"))
    assert len(robot.joint_names) == 2
    assert name not in robot.joint_names
    move(robot)


@pytest.mark.parametrize("kind", ["fixed", "prismatic"])
def test_a_joint_that_does_not_turn_is_no_wheel(robotd: Robotd, tmp_path: Path, kind: str) -> None:
    wheels = joint("l", "base", "a", LIMIT, kind, "0.2") + joint("r", "base", "b", LIMIT, kind)
    urdf = tmp_path / "it.urdf"
    urdf.write_text(f'<robot name="it"><link name="base"/>\n{wheels}</robot>', encoding="utf-8")
    options = ["--wheels", "l,r", "--wheel-radius", "0.1"]
    result = robotd("new-robot", "it", "--urdf", str(urdf), "--into", str(tmp_path), *options)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert f"it.urdf:2: l: is {kind}: the joint of a wheel is continuous" in result.output


def test_wheels_that_turn_backwards_are_named(make: Make) -> None:
    left = joint("left_wheel", "base", "a", "", "continuous", "0.2")
    right = joint("right_wheel", "base", "b", "", "continuous", "-0.2")
    mirrored = right.replace('xyz="0 1 0"', 'xyz="0 -1 0"')
    _, output = make(left + mirrored, "--wheel-radius", "0.1")
    assert "wheels turn backwards in RViz and MuJoCo" in output
    assert "joints=['right_wheel']" in output
    assert "backwards" not in make(left + right, "--wheel-radius", "0.1")[1]
