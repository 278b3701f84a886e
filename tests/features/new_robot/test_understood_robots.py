"""``robotd new-robot`` understands wheels, hands, tools and virtual bases as the owner would."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import pytest
from tests.command_line import Robotd

import robotd_new_robot.new_robot_command as command
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.errors import DescriptorError
from robotd.robot import open_robot
from robotd_bases.diff_drive import DifferentialDrive
from robotd_bases.mecanum import MecanumDrive
from robotd_new_robot import Choices, RobotPlan, plan_robot
from robotd_new_robot.joint_roles import GripperDrive
from robotd_new_robot.wheels import BaseKind, disc_radius

MASS, RADIUS = 8.0, 0.2


def plan(body: str, choices: Choices | None = None) -> RobotPlan:
    text = f'<robot name="it"><link name="base"/>\n{body}</robot>'
    return plan_robot(text, Path("it.urdf"), choices or Choices())


def problem(body: str) -> str:
    with pytest.raises(DescriptorError) as error:
        plan(body)
    return str(error.value)


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>\n'


def joint(
    name: str,
    parent: str,
    child: str,
    xyz: str = "0 0 0.1",
    axis: str = "0 1 0",
    kind: str = "revolute",
    limits: tuple[float, float] = (-1.0, 1.0),
    more: str = "",
) -> str:
    limit = f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="5" velocity="2"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}{more}</joint>\n'
    )


def disc(name: str) -> str:
    """A wheel drawn as a mesh: only its inertia shows that it is a disc about y."""
    along, across = 0.5 * MASS * RADIUS**2, 0.25 * MASS * RADIUS**2
    return link(
        name,
        f'<inertial><mass value="{MASS}"/><inertia ixx="{across}" ixy="0" ixz="0" iyy="{along}"'
        f' iyz="0" izz="{across}"/></inertial><visual><geometry><mesh filename="a.stl"/></geometry>'
        "</visual>",
    )


def wheel(name: str, xyz: str, axis: str = "0 1 0", parent: str = "base") -> str:
    return joint(name, parent, f"{name}_link", xyz, axis, "continuous") + disc(f"{name}_link")


def steered(name: str, xyz: str, axis: str = "0 0 1") -> str:
    """A wheel ``name`` and the joint that steers it."""
    fork = joint(f"{name}_steering", "base", f"{name}_fork", xyz, axis) + link(f"{name}_fork")
    return fork + wheel(name, "0 0 0", parent=f"{name}_fork")


CORNERS = {"fl": "0.4 0.3 0.2", "fr": "0.4 -0.3 0.2", "rl": "-0.4 0.3 0.2", "rr": "-0.4 -0.3 0.2"}
FOUR_WHEELS = "".join(wheel(name, xyz) for name, xyz in CORNERS.items())


# ---- wheels and bases


def test_wheels_are_known_by_axis_shape_and_place() -> None:
    body = wheel("left_drive", "0 0.3 0.2") + wheel("right_drive", "0 -0.3 0.2")
    tilt = joint("tilt", "base", "camera", "0 0 0.6") + link("camera")
    made = plan(body + tilt, Choices(wheel_radius_m=RADIUS))
    assert made.roles.base is not None
    assert made.roles.base.kind is BaseKind.DIFFERENTIAL
    assert [joint.name for joint in made.roles.base.joints] == ["left_drive", "right_drive"]
    assert [joint.name for joint in made.roles.arm] == ["tilt"]


@pytest.mark.parametrize(
    "right",
    [
        wheel("right", "0 -0.3 0.2", axis="0 0 1"),  # a rotor
        wheel("right", "0 -0.3 0.7"),  # at another height
        wheel("right", "0.5 -0.3 0.2"),  # on another axle
        joint("right", "base", "r", "0 -0.3 0.2", kind="continuous") + link("r"),  # not round
    ],
)
def test_what_is_no_pair_of_wheels_is_no_base(right: str) -> None:
    assert plan(wheel("left", "0 0.3 0.2") + right, Choices()).roles.base is None


def test_a_wheel_that_does_not_touch_the_ground_is_none() -> None:
    body = wheel("left_wheel", "0 0.3 0.2") + wheel("right_wheel", "0 -0.3 0.2")
    body += wheel("hand_wheel", "0 0 0.9")
    base = plan(body, Choices(wheel_radius_m=RADIUS)).roles.base
    assert base is not None
    assert len(base.joints) == 2


@pytest.mark.parametrize("axis", ["0 0 1", "0 1 0"])  # exporters write the second for steering
def test_an_ackermann_base_is_said_to_be_one_that_no_plugin_drives(axis: str) -> None:
    rear = wheel("rl", CORNERS["rl"]) + wheel("rr", CORNERS["rr"])
    front = steered("fl_wheel", CORNERS["fl"], axis) + steered("fr_wheel", CORNERS["fr"], axis)
    text = problem(front + rear)
    assert "an Ackermann base, steered by fl_wheel_steering, fr_wheel_steering:" in text
    assert "no plugin drives one" in text
    assert "--wheels" not in text  # two of its wheels are not a base


def test_four_steered_wheels_are_no_arms() -> None:
    text = problem("".join(steered(name, xyz) for name, xyz in CORNERS.items()))
    assert "four-wheel steering" in text
    assert "fl_steering, fr_steering, rl_steering, rr_steering: no plugin drives one" in text


def test_one_steered_wheel_makes_a_tricycle() -> None:
    body = steered("front", "0.5 0 0.2") + wheel("rl", CORNERS["rl"]) + wheel("rr", CORNERS["rr"])
    assert "a tricycle, steered by front_steering, is described by hand" in problem(body)


def test_wheels_in_a_ring_are_omnidirectional() -> None:
    ring = ""
    for number in range(3):
        angle = number * math.tau / 3
        x, y = math.cos(angle), math.sin(angle)
        ring += wheel(f"wheel_{number}", f"{0.2 * x} {0.2 * y} 0.2", f"{x} {y} 0")
    assert "omnidirectional wheels" in problem(ring)


def test_the_radius_of_a_disc_follows_from_its_inertia() -> None:
    body = wheel("left_wheel", "0 0.3 0.2") + wheel("right_wheel", "0 -0.3 0.2")
    assert "pass --wheel-radius METRES; a disc of its inertia has 0.2 m" in problem(body)
    urdf = plan(body, Choices(base=False)).urdf
    assert disc_radius(urdf, urdf.joint["left_wheel"]) == pytest.approx(RADIUS)


def test_rollers_show_a_mecanum_base() -> None:
    rollers = "".join(
        joint(f"{name}_roller", f"{name}_link", f"{name}_r", kind="continuous") + link(f"{name}_r")
        for name in CORNERS
    )
    base = plan(FOUR_WHEELS + rollers, Choices(wheel_radius_m=RADIUS)).roles.base
    assert base is not None
    assert base.kind is BaseKind.MECANUM


@pytest.fixture
def make(robotd: Robotd, tmp_path: Path) -> Callable[..., tuple[RobotDescriptor, str]]:
    """Make the robot of a URDF by the command; return it, and what was printed."""

    def run(body: str, *options: str) -> tuple[RobotDescriptor, str]:
        urdf = tmp_path / "it.urdf"
        text = f'<robot name="it"><link name="base"/>\n{body}</robot>'
        urdf.write_text(text, encoding="utf-8")
        where = ["--urdf", str(urdf), "--into", str(tmp_path)]
        result = robotd("new-robot", "it", *where, *options)
        assert result.exit_code == 0, result.output
        return load_robot_descriptor(tmp_path / "it"), result.output

    return run


def test_a_mecanum_base_moves_to_the_left(
    make: Callable[..., tuple[RobotDescriptor, str]],
) -> None:
    robot, _ = make(FOUR_WHEELS, "--base", "mecanum", "--wheel-radius", str(RADIUS))
    drive = robot.drive
    assert isinstance(drive, MecanumDrive)
    assert drive.wheel_joints == ("fl", "fr", "rl", "rr")
    assert (drive.wheelbase_m, drive.wheel_separation_m) == (0.8, 0.6)
    assert robot.nodes[-1] == "mecanum_drive_controller"
    assert robot.path is not None
    with open_robot(robot.path, clock=SteppedClock()) as served:
        assert served.base is not None
        deadline = time.monotonic() + 20.0
        while served.base.pose.y < 0.02:
            assert time.monotonic() < deadline, "the base does not move"
            served.base.command(0.0, 0.0, 0.1)
            served.step(5)
            time.sleep(1e-3)  # for the thread that claims the wheels
        turning = dict(zip(drive.axes, served.image.velocity[list(drive.axes)], strict=True))
        wheels = {
            "fl": turning[drive.front_left_axis],
            "fr": turning[drive.front_right_axis],
            "rl": turning[drive.rear_left_axis],
            "rr": turning[drive.rear_right_axis],
        }
        assert {name: speed > 0.0 for name, speed in wheels.items()} == {
            "fl": False,
            "fr": True,
            "rl": True,
            "rr": False,
        }


@pytest.mark.parametrize(
    ("body", "choices", "text"),
    [
        (joint("a", "base", "b") + link("b"), Choices(kind=BaseKind.MECANUM), "no wheels were"),
        (
            wheel("l", "0 0.3 0.2") + wheel("r", "0 -0.3 0.2"),
            Choices(kind=BaseKind.MECANUM, wheel_radius_m=RADIUS),
            "2 wheels make no mecanum base",
        ),
    ],
)
def test_a_kind_that_the_wheels_do_not_make_is_rejected(
    body: str, choices: Choices, text: str
) -> None:
    with pytest.raises(DescriptorError, match=text):
        plan(body, choices)


@pytest.mark.parametrize("mass", ["", '<inertial><mass value="1"/></inertial>'])
def test_joints_that_stand_for_a_base_have_no_axis(mass: str) -> None:
    body = joint("root_x", "base", "x", axis="1 0 0", kind="prismatic", limits=(-10, 10))
    body += joint("root_y", "x", "y", axis="0 1 0", kind="prismatic", limits=(-10, 10))
    body += joint("root_turn", "y", "body", axis="0 0 1", kind="continuous")
    body += joint("lift", "body", "top", axis="0 0 1", kind="prismatic")
    made = plan(body + link("x", mass) + link("y", mass) + link("body") + link("top"))
    assert [joint.name for joint in made.roles.arm] == ["lift"]
    assert [joint.name for joint, _ in made.roles.passive] == ["root_x", "root_y", "root_turn"]


def test_a_rail_below_an_arm_is_an_axis() -> None:
    body = joint("base_rail", "base", "a", axis="1 0 0", kind="prismatic", limits=(0, 3))
    body += joint("base_turn", "a", "b", axis="0 0 1") + link("a") + link("b")
    assert [joint.name for joint in plan(body).roles.arm] == ["base_rail", "base_turn"]


# ---- grippers, hands and tools


def arm(prefix: str = "", base: str = "base", names: str = "pan lift elbow roll") -> str:
    """An arm of links 0.3 m long, each with its joint's name and ``_link``."""
    parts, parent = "", base
    for name in names.split():
        child = f"{prefix}{name}_link"
        parts += joint(f"{prefix}{name}", parent, child, "0 0 0.3") + link(child)
        parent = child
    return parts


def frame(name: str, parent: str) -> str:
    fixed = f'<joint name="{name}_joint" type="fixed"><parent link="{parent}"/>'
    return f'{fixed}<child link="{name}"/><origin xyz="0 0 0.1"/></joint>{link(name)}'


def groups(made: RobotPlan) -> dict[str, list[str]]:
    return {name: [joint.name for joint in held] for name, held in made.groups.items()}


@pytest.mark.parametrize("name", ["gripper", "joint_5"])  # the second by the frame beside it
def test_a_jaw_is_no_axis_of_the_arm_nor_its_tool(name: str) -> None:
    jaw = joint(name, "roll_link", "moving_part", "0.02 0 0.02") + link("moving_part")
    made = plan(arm() + frame("gripper_frame_link", "roll_link") + jaw)
    assert groups(made) == {"arm": ["pan", "lift", "elbow", "roll"], "gripper": [name]}
    assert made.tools == {"arm": "gripper_frame_link"}
    assert made.roles.fingers is None  # no valve moves one jaw


def test_a_wrist_called_after_the_gripper_is_an_axis_of_the_arm() -> None:
    wrist = joint("gripper_roll", "roll_link", "tool") + link("tool")
    assert groups(plan(arm() + wrist)) == {}


def test_fingers_of_two_arms_are_groups_of_their_own() -> None:
    body = ""
    for side in ("panda_1_", "panda_2_"):
        body += arm(side, names="joint1 joint2 joint3") + link(f"{side}a") + link(f"{side}b")
        follows = f'<mimic joint="{side}finger_joint1"/>'
        hand = f"{side}joint3_link"
        for number, tip, more in ((1, "a", ""), (2, "b", follows)):
            name = f"{side}finger_joint{number}"
            body += joint(name, hand, side + tip, kind="prismatic", limits=(0, 0.04), more=more)
    assert groups(plan(body)) == {
        "panda_1": ["panda_1_joint1", "panda_1_joint2", "panda_1_joint3"],
        "panda_2": ["panda_2_joint1", "panda_2_joint2", "panda_2_joint3"],
        "panda_1_gripper": ["panda_1_finger_joint1"],
        "panda_2_gripper": ["panda_2_finger_joint1"],
    }


def fingers(length_m: float) -> str:
    """Three branches of two joints at the end of the arm."""
    body = ""
    for name in ("a", "b", "c"):
        body += joint(f"{name}0", "roll_link", f"{name}0_link", "0 0 0.05")
        body += joint(f"{name}1", f"{name}0_link", f"{name}1_link", f"0 0 {length_m}")
        body += link(f"{name}0_link") + link(f"{name}1_link")
    return body


def test_short_branches_at_the_end_of_an_arm_are_a_hand() -> None:
    made = groups(plan(arm() + fingers(0.05)))
    assert made == {
        "arm": ["pan", "lift", "elbow", "roll"],
        "hand": ["a0", "a1", "b0", "b1", "c0", "c1"],
    }
    assert len(groups(plan(arm() + fingers(0.5)))) == 4  # three arms on a torso


def test_mirrored_slides_are_one_gripper() -> None:
    body = arm() + link("l") + link("r")
    body += joint("jaw_l", "roll_link", "l", "0 0.02 0", kind="prismatic", limits=(0, 0.05))
    body += joint("jaw_r", "roll_link", "r", "0 -0.02 0", kind="prismatic", limits=(-0.05, 0))
    made = plan(body)
    assert made.roles.fingers is not None
    assert made.roles.fingers.multipliers == (1.0, -1.0)


@pytest.mark.parametrize(
    ("frames", "tool"),
    [
        (("tool0", "camera_tool"), "tool0"),
        (("flange", "tool0", "hand_tcp"), "hand_tcp"),
        (("imu",), None),
    ],
)
def test_the_tool_of_an_arm_is_a_frame_called_so(frames: tuple[str, ...], tool: str) -> None:
    made = plan(arm() + "".join(frame(name, "roll_link") for name in frames))
    assert made.tools.get("joints") == tool


# ---- table and dialogue

GRIPPER = arm() + "".join(
    joint(f"finger_{n}", "roll_link", f"tip_{n}", kind="prismatic", limits=(0, 0.04))
    + link(f"tip_{n}")
    for n in (1, 2)
)


def test_what_was_understood_is_one_table(
    make: Callable[..., tuple[RobotDescriptor, str]],
) -> None:
    jaw = joint("gripper", "roll_link", "jaw") + link("jaw")
    _, output = make(arm() + frame("tcp", "roll_link") + jaw, "--limits", "pan=-0.5,0.5")
    rows = [line.split() for line in output.splitlines()]
    assert ["pan", "arm", "joint,", "axis", "0", "-0.5", "to", "0.5", "rad", "option"] in rows
    assert ["gripper", "gripper", "finger,", "axis", "4", "-1", "to", "1", "rad", "URDF"] in rows
    assert ["tcp", "arm", "tool", "(link)", "its", "name"] in rows


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch) -> list[str | None]:
    """Answers of a person at the terminal, in order; None takes the default."""
    answers: list[str | None] = []

    def prompt(_text: str, **options: Any) -> object:
        answer = answers.pop(0)
        return options["default"] if answer is None else options["type"].convert(answer, None, None)

    monkeypatch.setattr(command, "_is_interactive", lambda: True)
    monkeypatch.setattr(click, "prompt", prompt)
    return answers


def test_a_person_chooses_the_kind_of_the_base_and_confirms_the_radius(
    make: Callable[..., tuple[RobotDescriptor, str]], person: list[str | None]
) -> None:
    person += ["mecanum", None]
    robot, _ = make(FOUR_WHEELS)
    assert isinstance(robot.drive, MecanumDrive)
    assert robot.drive.wheel_radius_m == RADIUS
    assert person == []


def test_a_person_chooses_the_drive_of_the_gripper(
    make: Callable[..., tuple[RobotDescriptor, str]], person: list[str | None]
) -> None:
    person += [str(GripperDrive.AXIS)]
    robot, _ = make(GRIPPER)
    assert robot.gripper is None
    assert robot.groups["gripper"].joints == ("finger_1",)


def test_a_person_is_not_asked_for_what_an_option_says(
    make: Callable[..., tuple[RobotDescriptor, str]], person: list[str | None]
) -> None:
    robot, _ = make(GRIPPER, "--gripper", "output")  # an answer would be missing
    assert robot.gripper is not None


def test_a_base_of_unnamed_wheels_is_differential(
    make: Callable[..., tuple[RobotDescriptor, str]],
) -> None:
    body = wheel("left_drive", "0 0.3 0.2") + wheel("right_drive", "0 -0.3 0.2")
    robot, output = make(body, "--wheel-radius", "0.2")
    assert isinstance(robot.drive, DifferentialDrive)
    row = next(line for line in output.splitlines() if line.startswith("left_drive"))
    assert "base (differential)  left wheel, axis 0" in row
    assert row.endswith("axis, shape and place")
