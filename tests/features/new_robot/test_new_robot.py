"""``robotd new-robot``: any shape of robot passes the checks and moves on the simulation."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.command_line import Robotd

from robotd.cli.exit_codes import ExitCode
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot, open_robot
from robotd_bases.diff_drive import DifferentialDrive, SkidSteerDrive

URDFS = Path(__file__).parents[2] / "urdf"
SHAPES = sorted(path.stem for path in URDFS.glob("*.urdf"))
MOTION_S = 6.0

New = Callable[..., RobotDescriptor]


@pytest.fixture
def new(robotd: Robotd, tmp_path: Path) -> New:
    """Make the robot of a URDF; checked by the command itself."""

    def make(name: str, *options: str) -> RobotDescriptor:
        urdf = str(URDFS / f"{name}.urdf")
        result = robotd("new-robot", name, "--urdf", urdf, "--into", str(tmp_path), *options)
        assert result.exit_code == 0, result.output
        assert "all checks passed" in result.stdout
        assert "warn" not in result.output
        return load_robot_descriptor(tmp_path / name)

    return make


def targets(robot: Robot) -> list[float]:
    """A fifth of its range from where each joint is."""
    found = []
    for joint, now in zip(robot.descriptor.joints, robot.image.position_command, strict=False):
        step = min(0.2 * (joint.upper - joint.lower), 0.3 * joint.velocity * MOTION_S)
        found.append(now + step if now + step < joint.upper else now - step)
    return found


def goal(names: Sequence[str], wanted: Mapping[str, float]) -> TrajectoryRequest:
    return TrajectoryRequest.from_rows(names, [MOTION_S], [[wanted[name] for name in names]])


def drive_base(robot: Robot) -> None:
    """Command the base until its thread has claimed the wheels and they turn."""
    assert robot.base is not None
    deadline = time.monotonic() + 20.0
    while robot.base.pose.x < 0.02:
        assert time.monotonic() < deadline, "the base does not move"
        robot.base.command(0.1, 0.0)
        robot.step(5)
        time.sleep(1e-3)  # for the thread that claims the wheels


@pytest.mark.parametrize("shape", SHAPES)
def test_it_moves_on_the_simulation(new: New, shape: str) -> None:
    descriptor = new(shape)
    assert descriptor.path is not None
    with open_robot(descriptor.path, clock=SteppedClock()) as robot:
        if robot.joint_names:
            wanted = dict(zip(robot.joint_names, targets(robot), strict=True))
            with ExitStack() as stack:  # the groups move at the same time
                executions = [
                    stack.enter_context(group.follower.follow(goal(group.joint_names, wanted)))
                    for group in robot.groups.values()
                ]
                robot.step(round((MOTION_S + 2.0) * descriptor.cycle.rate_hz))
                for execution in executions:
                    assert execution.outcome is Outcome.SUCCEEDED, execution.message
            measured = robot.image.position[list(robot.joint_axes)]
            assert measured == pytest.approx(list(wanted.values()), abs=0.01)
        if robot.base is not None:
            drive_base(robot)
            assert abs(robot.base.pose.y) < 1e-6


def test_limits_and_types_are_those_of_the_urdf(new: New) -> None:
    joints = new("scara").joints
    assert [joint.unit for joint in joints] == ["rad", "rad", "m", "rad"]
    assert (joints[2].lower, joints[2].upper, joints[2].velocity) == (0.0, 0.15, 1.1)
    assert joints[2].acceleration == pytest.approx(1.1 / 0.25)
    assert new("seven_axis").joints[6].type == "continuous"


def test_joints_begin_inside_of_their_limits(new: New) -> None:
    descriptor = new("seven_axis")
    assert descriptor.path is not None
    with open_robot(descriptor.path, clock=SteppedClock()) as robot:
        assert robot.problems == []
        for joint, start in zip(descriptor.joints, robot.image.position, strict=False):
            assert joint.lower < start < joint.upper


def test_fingers_become_a_gripper_that_knows_its_ends(new: New) -> None:
    turning, sliding = new("six_axis").gripper, new("seven_axis").gripper
    assert turning is not None
    assert turning.joints == ("left_finger_joint", "right_finger_joint")
    assert turning.multipliers == (1.0, -1.0)
    assert sliding is not None
    assert (sliding.open_m, sliding.closed_m) == (0.04, 0.0)  # the fingers are further apart


def test_a_servo_gripper_is_a_joint(new: New) -> None:
    robot = new("six_axis", "--gripper", "axis")
    assert robot.gripper is None
    assert robot.joint_names[-1] == "left_finger_joint"
    groups = {name: len(group.joints) for name, group in robot.groups.items()}
    assert groups == {"arm": 6, "gripper": 1}


def test_wheels_are_told_apart_by_their_side(new: New) -> None:
    robot = new("mobile_base")
    assert robot.path is not None
    drive = robot.drive
    assert isinstance(drive, DifferentialDrive)
    assert (drive.wheel_radius_m, drive.wheel_separation_m) == (0.1, 0.4)
    text = robot.path.read_text(encoding="utf-8")
    assert "# Wheels left_wheel_joint on the left, right_wheel_joint on the right." in text
    assert re.search(r"#   caster_(wheel_)?joint: a passive wheel", text)
    assert "10.0      # assumed: the URDF has none" in text


WHEELS = [f"{end}_{side}_wheel" for side in ("left", "right") for end in ("front", "rear")]


def four_wheels(steered: str = "") -> str:
    """A URDF on four wheels; the ``steered`` end has a steering joint for each of its wheels."""
    parts = ['<robot name="rover"><link name="base_link"/>']
    for wheel in WHEELS:
        x, y = (0.3 if "front" in wheel else -0.3), (0.25 if "left" in wheel else -0.25)
        parent, place = "base_link", f"{x} {y} 0"
        if steered and steered in wheel:
            parts.append(
                f'<link name="{wheel}_fork"/><joint name="{wheel}_turn" type="revolute">'
                f'<parent link="base_link"/><child link="{wheel}_fork"/><origin xyz="{place}"/>'
                '<axis xyz="0 0 1"/><limit lower="-0.5" upper="0.5" effort="1" velocity="1"/>'
                "</joint>"
            )
            parent, place = f"{wheel}_fork", "0 0 0"
        parts.append(
            f'<joint name="{wheel}" type="continuous"><parent link="{parent}"/>'
            f'<child link="{wheel}_link"/><origin xyz="{place}"/><axis xyz="0 1 0"/>'
            f'<limit effort="10" velocity="9"/></joint><link name="{wheel}_link"><collision>'
            '<geometry><cylinder radius="0.1" length="0.05"/></geometry></collision></link>'
        )
    return "\n".join([*parts, "</robot>"])


@pytest.fixture
def rover(robotd: Robotd, tmp_path: Path) -> Callable[..., tuple[RobotDescriptor, str]]:
    """Make the robot of a URDF on four wheels; also return what was printed."""

    def make(*wheels: str, steered: str = "") -> tuple[RobotDescriptor, str]:
        urdf = tmp_path / "four.urdf"
        urdf.write_text(four_wheels(steered), encoding="utf-8")
        options = ["--wheels", ",".join(wheels)] if wheels else []
        result = robotd(
            "new-robot", "rover", "--urdf", str(urdf), "--into", str(tmp_path), *options
        )
        assert result.exit_code == 0, result.output
        return load_robot_descriptor(tmp_path / "rover"), result.output

    return make


def test_several_wheels_a_side_make_a_skid_steer_base(rover: Any) -> None:
    robot, output = rover(*WHEELS)
    drive = robot.drive
    assert isinstance(drive, SkidSteerDrive)
    assert (drive.left_axes, drive.right_axes) == ((0, 1), (2, 3))
    assert drive.wheel_joints == tuple(WHEELS)
    assert (drive.wheel_radius_m, drive.wheel_separation_m) == (0.1, 0.5)
    assert robot.joints == ()
    assert "warn" not in output
    with open_robot(robot.path, clock=SteppedClock()) as served:
        drive_base(served)
        speeds = served.image.velocity
        assert (speeds > 0.1).all()


def test_four_wheels_are_asked_for_with_the_command(robotd: Robotd, tmp_path: Path) -> None:
    urdf = tmp_path / "four.urdf"
    urdf.write_text(four_wheels(), encoding="utf-8")
    result = robotd("new-robot", "rover", "--urdf", str(urdf), "--into", str(tmp_path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert f"4 wheels ({','.join(WHEELS)}): pass --base skid_steer or --base" in result.stderr


@pytest.mark.parametrize("end", ["front", "rear"])
def test_wheels_that_are_not_named_are_not_held_by_an_axis(rover: Any, end: str) -> None:
    robot, _ = rover(f"{end}_left_wheel", f"{end}_right_wheel")
    assert robot.joints == ()
    assert robot.axes == 2
    others = "rear" if end == "front" else "front"
    text = robot.path.read_text(encoding="utf-8")
    assert f"#   {others}_left_wheel: a wheel that is not driven" in text


def test_what_steers_an_undriven_wheel_is_not_held_by_an_axis(rover: Any) -> None:
    robot, _ = rover("rear_left_wheel", "rear_right_wheel", steered="front")
    assert robot.joints == ()
    text = robot.path.read_text(encoding="utf-8")
    assert "#   front_left_wheel_turn: steers front_left_wheel, which is not driven" in text


def test_the_named_sides_win_over_the_geometry_and_the_contradiction_is_told(rover: Any) -> None:
    robot, output = rover("front_right_wheel", "front_left_wheel")
    assert robot.drive.wheel_joints == ("front_right_wheel", "front_left_wheel")
    assert "warn  drive.wheel_joints: front_right_wheel, a left wheel, is at y -0.25 m" in output


@pytest.mark.parametrize(
    ("wheels", "steered", "text"),
    [
        (WHEELS[:3], "", "a base has as many left as right wheels"),
        (WHEELS[::2] + WHEELS[1::2], "", "the wheels are not on two sides"),
        (WHEELS, "front", "front_left_wheel: the wheel is steered by front_left_wheel_turn"),
    ],
)
def test_wheels_that_make_no_base_are_rejected(
    robotd: Robotd, tmp_path: Path, wheels: list[str], steered: str, text: str
) -> None:
    urdf = tmp_path / "four.urdf"
    urdf.write_text(four_wheels(steered), encoding="utf-8")
    options = ["--urdf", str(urdf), "--into", str(tmp_path), "--wheels", ",".join(wheels)]
    result = robotd("new-robot", "rover", *options)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert text in result.stderr
    assert not (tmp_path / "rover").exists()


def test_drive_models_carry_the_masses_of_the_urdf(new: New) -> None:
    gantry = new("gantry").backends["sim"]
    assert gantry["inertia_kg_m2"] == [61.0, 21.0, 6.0]  # kg: each axis carries the next
    scara = new("scara").backends["sim"]["inertia_kg_m2"]
    arm = 3.0 * 0.225**2 + 0.9 * 0.4**2 + 4 * 0.01
    assert scara[0] == pytest.approx(arm, rel=1e-2)  # by the parallel axis theorem


def test_accelerations_follow_from_the_ramp_time(new: New) -> None:
    joint = new("six_axis", "--ramp-time", "0.5").joints[0]
    assert joint.acceleration == pytest.approx(2.0 * joint.velocity)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--wheels", "left_wheel_joint"], "a base has as many left as right wheels"),
        (["--wheels", "left_wheel_joint,lef"], "has no joint 'lef' for --wheels"),
        (["--passive", "caster"], "has no joint 'caster' for --passive"),
        (["--wheels", "caster_joint,caster_wheel_joint"], "the wheels are not on two sides"),
    ],
)
def test_what_a_urdf_cannot_give_is_asked_for(
    robotd: Robotd, tmp_path: Path, options: list[str], text: str
) -> None:
    urdf = str(URDFS / "mobile_base.urdf")
    result = robotd("new-robot", "rover", "--urdf", urdf, "--into", str(tmp_path), *options)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert text in result.stderr
    assert not (tmp_path / "rover").exists()


def test_a_bad_urdf_writes_nothing(robotd: Robotd, tmp_path: Path) -> None:
    urdf = tmp_path / "bad.urdf"
    text = (URDFS / "scara.urdf").read_text(encoding="utf-8")
    urdf.write_text(text.replace('velocity="1.1"', 'velocity="fast"'), encoding="utf-8")
    result = robotd("new-robot", "bad", "--urdf", str(urdf), "--into", str(tmp_path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "bad.urdf:" in result.stderr
    assert "joint3: velocity='fast' is not a finite number" in result.stderr
    assert not (tmp_path / "bad").exists()


def test_a_folder_is_not_overwritten(robotd: Robotd, new: New, tmp_path: Path) -> None:
    robot = new("gantry")
    assert robot.path is not None
    before = robot.path.read_bytes()
    urdf = str(URDFS / "scara.urdf")
    result = robotd("new-robot", "gantry", "--urdf", urdf, "--into", str(tmp_path))
    assert result.exit_code == ExitCode.FAILED
    assert "exists already" in result.stderr
    assert robot.path.read_bytes() == before


def test_two_arms_are_listed_arm_by_arm(new: New) -> None:
    names = new("two_arms").joint_names
    assert names[0] == "torso_joint"
    assert [name.split("_")[0] for name in names[1:]] == ["left"] * 6 + ["right"] * 6
    assert len(np.unique(names)) == 13


def test_branches_of_the_tree_become_groups(new: New) -> None:
    robot = new("two_arms")
    assert {name: len(group.joints) for name, group in robot.groups.items()} == {
        "torso": 1,
        "left": 6,
        "right": 6,
    }
    assert robot.groups["left"].joints[0] == "left_joint1"


def test_a_new_robot_serves_the_nodes_of_those_in_the_box(new: New) -> None:
    nodes = load_robot_descriptor("standalone").nodes
    assert {*nodes} <= {*new("scara").nodes}


def test_all_joints_are_one_group_on_demand(new: New) -> None:
    robot = new("two_arms", "--no-groups")
    assert robot.groups == {}
    server = robot.ros_parameters["follow_joint_trajectory_server"]
    assert server == {"joint_trajectory_action": "two_arms_arm_controller/follow_joint_trajectory"}


@pytest.mark.parametrize("shape", sorted({*SHAPES} - {"two_arms"}))
def test_a_single_chain_has_no_groups(new: New, shape: str) -> None:
    assert new(shape).groups == {}


def test_the_tutorial_shows_the_errors_of_its_robot(robotd: Robotd, tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs/tutorial/own-robot.md").read_text(encoding="utf-8")
    text = page.partition("```xml\n")[2].partition("```")[0]
    text = text.replace('velocity="2.0"', 'velocity="fast"')
    text = text.replace('<parent link="column"/>', '<parent link="colum"/>')
    urdf = tmp_path / "press.urdf"
    urdf.write_text(text, encoding="utf-8")
    result = robotd("new-robot", "press", "--urdf", str(urdf), "--into", str(tmp_path))
    shown = page.partition("```text\n")[2].partition("```")[0]
    assert result.stderr.replace(f"{tmp_path}/", "") == shown


def bus(tmp_path: Path, drives: int) -> str:
    """A scan with drives that state their scale."""
    axes = [{"node": 10 + number, "counts_per_rad": 1000.0} for number in range(drives)]
    scan = {
        "backend": "canopen",
        "scale": "counts_per_rad",
        "options": {"bus": {"interface": "virtual", "channel": "scan"}, "sync_period_s": 0.004},
        "axes": axes,
        "io": [{"node": 40, "input_length": 1, "output_length": 1}],
        "nodes": [],
    }
    path = tmp_path / "bus.json"
    path.write_text(json.dumps(scan), encoding="utf-8")
    return str(path)


def test_scanned_drives_are_given_to_the_joints(new: New, tmp_path: Path) -> None:
    robot = new("six_axis", "--bus", bus(tmp_path, 7))
    section = robot.backends["canopen"]
    assert [(axis["axis"], axis["node"]) for axis in section["axes"]] == [
        (axis, 10 + axis) for axis in range(6)
    ]
    assert section["io"] == [{"node": 40, "input_length": 1, "output_length": 1}]
    assert robot.path is not None
    assert "# no joint: {node: 16, counts_per_rad: 1000.0}" in robot.path.read_text("utf-8")
    assert load_backend("canopen").context(robot) is not None


def test_a_bus_alone_is_a_robot_with_a_joint_for_each_drive(robotd: Robotd, tmp_path: Path) -> None:
    path = bus(tmp_path, 3)
    result = robotd("new-robot", "axes", "--bus", path, "--into", str(tmp_path))
    assert result.exit_code == 0, result.output
    robot = load_robot_descriptor(tmp_path / "axes")
    assert robot.joint_names == ("node10", "node11", "node12")
    assert robot.urdf is None
    assert [axis["node"] for axis in robot.backends["canopen"]["axes"]] == [10, 11, 12]
    assert load_backend("canopen").context(robot) is not None
    assert robot.path is not None
    with open_robot(robot.path, clock=SteppedClock()) as moving:
        step = TrajectoryRequest.from_rows(robot.joint_names, [MOTION_S], [[0.5, -0.5, 0.2]])
        with moving.follower.follow(step) as execution:
            moving.step(round((MOTION_S + 2.0) * robot.cycle.rate_hz))
            assert execution.outcome is Outcome.SUCCEEDED, execution.message


def test_axes_of_one_drive_and_drives_without_a_number_have_names_too(
    robotd: Robotd, tmp_path: Path
) -> None:
    axes = [{"slave": 0}, {"slave": 0}, {"vendor_id": 7}]
    path = tmp_path / "bus.json"
    path.write_text(json.dumps({"backend": "wmx", "options": {}, "axes": axes}))
    robotd("new-robot", "axes", "--bus", str(path), "--into", str(tmp_path))
    assert load_robot_descriptor(tmp_path / "axes").joint_names == ("slave0", "slave0_2", "joint3")


def test_a_scale_in_doubt_is_a_comment_of_its_line(robotd: Robotd, tmp_path: Path) -> None:
    scan = json.loads(Path(bus(tmp_path, 1)).read_text(encoding="utf-8"))
    scan["axes"][0]["remark"] = "scale in doubt: measure it"
    path = tmp_path / "doubt.json"
    path.write_text(json.dumps(scan), encoding="utf-8")
    robotd("new-robot", "axes", "--bus", str(path), "--into", str(tmp_path))
    text = (tmp_path / "axes" / "robot.yaml").read_text(encoding="utf-8")
    assert "# node10; scale in doubt: measure it\n" in text
    assert load_backend("canopen").context(load_robot_descriptor(tmp_path / "axes")) is not None


def test_an_empty_bus_is_no_robot(robotd: Robotd, tmp_path: Path) -> None:
    result = robotd("new-robot", "axes", "--bus", bus(tmp_path, 0), "--into", str(tmp_path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "bus.json: axes: has 0 drives, a robot has 1 to 128" in result.stderr


def test_the_scale_of_a_prismatic_joint_has_to_be_added(
    robotd: Robotd, new: New, tmp_path: Path
) -> None:
    robot = new("scara", "--bus", bus(tmp_path, 4))
    assert robot.path is not None
    result = robotd("check", "--robot", str(robot.path), "--backend", "canopen")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "backends.canopen.axes.2.counts_per_rad: missing" in result.stdout
    text = robot.path.read_text(encoding="utf-8")
    scaled = text.replace("{axis: 2, node: 12}", "{axis: 2, node: 12, counts_per_rad: 500000.0}")
    robot.path.write_text(scaled, encoding="utf-8")
    result = robotd("check", "--robot", str(robot.path), "--backend", "canopen")
    assert result.exit_code == 0, result.output


def test_drives_of_a_backend_without_axes_in_the_descriptor_are_noted(
    new: New, tmp_path: Path
) -> None:
    axes = [{"slave": number, "vendor_id": 7} for number in range(6)]
    path = tmp_path / "bus.json"
    path.write_text(json.dumps({"backend": "wmx", "options": {}, "axes": axes, "slaves": []}))
    robot = new("six_axis", "--bus", str(path))
    assert robot.backends["wmx"] == {}
    assert robot.path is not None
    text = robot.path.read_text("utf-8")
    assert f"# axis 5, {robot.joint_names[5]}: {{slave: 5, vendor_id: 7}}" in text


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("node 1: CiA 402", "bus.json: is not a bus scan: Expecting value"),
        ("{}", "bus.json: backend: is not a bus scan: Field required"),
        (None, "bus.json: axes: has 3 drives, the robot has 6 axes"),
    ],
)
def test_a_scan_that_does_not_fit_is_named(
    robotd: Robotd, tmp_path: Path, content: str | None, text: str
) -> None:
    path = Path(bus(tmp_path, 3))
    if content is not None:
        path.write_text(content, encoding="utf-8")
    urdf = str(URDFS / "six_axis.urdf")
    arguments = ("--urdf", urdf, "--bus", str(path), "--into", str(tmp_path))
    result = robotd("new-robot", "arm", *arguments)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert text in result.stderr
    assert not (tmp_path / "arm").exists()
