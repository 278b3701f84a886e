"""The tool of a simulated robot: moves, frames, rejections."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotd import Robot, open_robot
from robotd.api import (
    DescriptorError,
    FloatArray,
    InvalidArgument,
    NotReady,
    OperationError,
    Profile,
    RobotDescriptor,
    read_urdf,
)
from robotd.api.features import ProcessImage
from robotd.api.robots import JointLimits
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Move
from robotd.robot import build_robot
from robotd_tool_space import (
    Kinematics,
    Line,
    PathOutput,
    Unreachable,
    Wait,
    pose_differences,
    pose_of,
)
from robotd_tool_space.frames.tool_frames import CUSTOM_FRAME, CUSTOM_TOOL
from robotd_tool_space.paths.tool_motion import plan_joint_motion
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.tool_groups import ToolGroups

BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "arm" / "robot.yaml"
    path.parent.mkdir()
    path.write_text(
        "extends: cr3a\nname: arm\ntool_space:\n"
        "  velocity_m_s: 0.4\n"
        "  tools:\n    tip: {xyz_m: [0.0, 0.0, 0.15]}\n"
        "  work_frames:\n    table: {xyz_m: [0.3, 0.0, 0.0], "
        f"rpy_rad: [0.0, 0.0, {np.pi / 2}]}}\n",
        encoding="utf-8",
    )
    return path


@pytest.fixture
def robot(file: Path) -> Iterator[Robot]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        tool = robot.feature(ToolGroups).only
        limits = tool.group.follower.limits
        tool.execute(plan_joint_motion(tool.kinematics, limits, tool.start(), BENT, tool.speed))
        yield robot


@pytest.fixture
def tool(robot: Robot) -> RobotTool:
    return robot.feature(ToolGroups).only


def test_a_line_moves_the_tool(robot: Robot, tool: RobotTool) -> None:
    before = tool.pose
    tool.move_line(tool.pose_relative(z=0.05))
    expected = before.copy()
    expected[2, 3] += 0.05
    assert tool.pose == pytest.approx(expected, abs=1e-6)
    measured = tool.measured_pose()
    assert measured is not None
    assert measured == pytest.approx(expected, abs=1e-3)


def test_ways_in_the_frame_of_the_tool(tool: RobotTool) -> None:
    before = tool.pose
    tool.move_to(tool.pose_relative("tool", z=0.03, yaw=0.2))
    assert tool.pose == pytest.approx(before @ pose_of([0, 0, 0.03], [0, 0, 0.2]), abs=1e-5)
    with pytest.raises(InvalidArgument, match="'world' must be 'base' or 'tool'"):
        tool.pose_relative("world", z=0.1)


def test_a_stream_of_twists_moves_the_tool(robot: Robot, tool: RobotTool) -> None:
    before = tool.pose
    with tool.stream(timeout_s=0.5, ends_when_silent=True) as stream:
        stream.send([0.0, 0.0, 0.05, 0.0, 0.0, 0.0], in_tool=True)
        with pytest.raises(InvalidArgument, match="must be 6 finite numbers"):
            stream.send([0.0, 0.0, np.nan, 0.0, 0.0, 0.0])
        robot.step(500)
    displacement = (tool.pose[:3, 3] - before[:3, 3]) @ before[:3, :3]
    assert displacement[:2] == pytest.approx(np.zeros(2), abs=1e-5)
    assert 0.015 < displacement[2] < 0.035


def test_components_that_are_not_given_stay(tool: RobotTool) -> None:
    wanted = tool.pose_with(z=tool.pose[2, 3] - 0.02)
    assert wanted[:2, 3] == pytest.approx(tool.pose[:2, 3])
    assert wanted[:3, :3] == pytest.approx(tool.pose[:3, :3])
    with pytest.raises(InvalidArgument, match="'hight' is none of x, y, z"):
        tool.pose_with(hight=1.0)
    with pytest.raises(InvalidArgument, match="z is nan, must be a finite number"):
        tool.pose_with(z=np.nan)


def test_what_cannot_be_reached_moves_nothing_and_is_an_event(
    robot: Robot, tool: RobotTool
) -> None:
    before = robot.image.copy().position.copy()
    with pytest.raises(Unreachable, match=r"^at \d+ % "):
        tool.move_line(tool.pose_relative(z=2.0))
    assert (robot.image.copy().position == before).all()
    texts = [event.text for event in robot.events.since(0)[0]]
    assert any(text.startswith("goal rejected: at ") for text in texts)


def test_frames_are_chosen_by_name_and_only_at_rest(robot: Robot, tool: RobotTool) -> None:
    bare = tool.pose
    tool.select_tool("tip")
    assert tool.pose == pytest.approx(bare @ pose_of([0.0, 0.0, 0.15]))
    tool.select_work_frame("table")
    table = pose_of([0.3, 0.0, 0.0], [0.0, 0.0, np.pi / 2])
    assert table @ tool.pose == pytest.approx(bare @ pose_of([0.0, 0.0, 0.15]))
    with pytest.raises(InvalidArgument, match=r"unknown tool 'tipp' \(available: tip\)"):
        tool.select_tool("tipp")
    motion = tool.plan_lines([tool.pose_relative(x=0.05)])
    with tool.follow(motion) as execution:
        robot.step(20)
        with pytest.raises(NotReady, match="tool '': the joints move"):
            tool.select_tool("")
        with pytest.raises(NotReady, match="a move of the tool: the joints move"):
            tool.plan_lines([bare])
        tool.wait(execution)
    assert tool.tool_name == "tip"
    assert [name for _, name, _ in tool.chosen_frames()] == ["tip", "table"]
    tool.select_tool("")
    tool.select_work_frame("")
    moved = pose_differences(bare, tool.pose)
    assert moved[1] == pytest.approx(0.05, abs=1e-5), "x of the table is y of the base"


@pytest.mark.parametrize(
    ("disturb", "reason"),
    [
        (lambda robot, tool: (robot.stop(), robot.reset()), "motion was stopped before"),
        (lambda robot, tool: tool.select_tool("tip"), "another tool or work frame was chosen"),
        (lambda robot, tool: tool.select_work_frame("table"), "another tool or work frame was"),
    ],
    ids=["stop and reset", "tool", "work frame"],
)
def test_what_changes_while_a_move_is_planned_keeps_it_from_moving(
    robot: Robot,
    tool: RobotTool,
    monkeypatch: pytest.MonkeyPatch,
    disturb: Callable[[Robot, RobotTool], Any],
    reason: str,
) -> None:
    pose, before, start = tool.pose_relative(x=0.05), robot.image.copy().position, tool.start

    def disturbed() -> FloatArray:
        disturb(robot, tool)
        return start()

    monkeypatch.setattr(tool, "start", disturbed)
    with pytest.raises(NotReady, match=reason):
        tool.move_line(pose)
    robot.step(100)
    assert robot.image.copy().position == pytest.approx(before, abs=1e-6)
    monkeypatch.undo()
    tool.move_line(tool.pose_relative(z=0.01))


def test_the_choice_that_is_made_last_is_published_last(tool: RobotTool) -> None:
    published: list[str] = []
    is_second = threading.Event()

    def publish() -> None:
        name = tool.tool_name
        if name == "tip":  # its thread is slow
            is_second.wait(0.3)
        published.append(name)
        is_second.set()

    tool.on_change = publish
    first = threading.Thread(target=tool.select_tool, args=("tip",))
    first.start()
    while tool.tool_name != "tip":
        time.sleep(0.001)
    tool.select_tool("")
    first.join()
    assert published == ["tip", ""]


def test_a_tool_that_is_not_in_the_file(tool: RobotTool) -> None:
    bare, frame = tool.pose, pose_of([0.01, 0.02, 0.1], [0.1, 0.2, 0.3])
    seen: list[str] = []
    tool.on_change = lambda: seen.append(tool.tool_name)
    tool.set_tool(frame)
    assert tool.pose == pytest.approx(bare @ frame)
    assert tool.tool_frame == pytest.approx(frame)
    assert [name for _, name, _ in tool.chosen_frames()] == seen == [CUSTOM_TOOL]
    with pytest.raises(InvalidArgument, match="tool has a number that is not finite"):
        tool.set_tool(np.full((4, 4), np.nan))
    tool.select_tool("tip")
    assert tool.tool_frame == pytest.approx(pose_of([0.0, 0.0, 0.15]))


def test_a_work_frame_that_is_not_in_the_file(robot: Robot, tool: RobotTool) -> None:
    bare, frame = tool.pose, pose_of([0.3, -0.1, 0.2], [0.1, 0.2, 0.3])
    tool.set_work_frame(frame)
    frame_before = frame.copy()
    frame[0, 3] = 9.0  # of the caller: it does not move the work frame
    assert frame_before @ tool.pose == pytest.approx(bare)
    assert tool.work_frame_name == CUSTOM_FRAME
    tool.move_line(tool.pose_relative(x=0.02))
    moved = tool.work_frame @ tool.pose
    assert moved[:3, 3] - bare[:3, 3] == pytest.approx(0.02 * frame_before[:3, 0], abs=1e-5)
    with pytest.raises(InvalidArgument, match="work frame has shape"):
        tool.set_work_frame(np.eye(3))
    with tool.follow(tool.plan_lines([tool.pose_relative(x=0.02)])) as execution:
        robot.step(20)
        with pytest.raises(NotReady, match="work frame 'custom_frame': the joints move"):
            tool.set_work_frame(frame_before)
        tool.wait(execution)
    tool.select_work_frame("table")
    with pytest.raises(InvalidArgument, match="unknown work frame 'custom_frame'"):
        tool.work_frame_of(CUSTOM_FRAME)


def test_joints_move_together(tool: RobotTool) -> None:
    goal = BENT + 0.1
    tool.execute(tool.plan_joints(goal))
    assert tool.start() == pytest.approx(goal)


def test_a_joint_that_the_device_moves_is_not_at_rest(robot: Robot, tool: RobotTool) -> None:
    robot.axes.move([Move(0, 0.5, Profile(1.0, 5.0, 5.0))])
    robot.step(100)
    with pytest.raises(NotReady, match="tool 'tip': the joints move"):
        tool.select_tool("tip")
    with pytest.raises(NotReady, match="work frame 'table': the joints move"):
        tool.select_work_frame("table")
    with pytest.raises(NotReady, match="a move of the tool: the joints move"):
        _ = tool.pose
    robot.step(1000)
    tool.select_tool("tip")


def test_a_stop_ends_the_motion_on_the_line(robot: Robot, tool: RobotTool) -> None:
    before = tool.pose
    motion = tool.plan_lines([tool.pose_relative(y=0.15)], speed=0.5)
    with tool.follow(motion) as execution:
        robot.step(200)
        execution.cancel()
        tool.wait(execution)
    off = pose_differences(before, tool.pose)
    assert 0.001 < off[1] < 0.149
    assert np.abs(np.delete(off, 1)).max() < 1e-4


@pytest.mark.parametrize("seed", range(6))
def test_pauses_and_speeds_on_the_way_keep_the_accelerations_of_the_tool(
    robot: Robot, tool: RobotTool, seed: int
) -> None:
    """Of the commands, by the kinematics of the URDF reader."""
    random, period_s = np.random.default_rng(seed), 1.0 / robot.descriptor.cycle.rate_hz
    urdf = read_urdf(robot.descriptor.urdf)
    motion = tool.plan_lines([tool.pose_relative(y=0.2, yaw=0.4), tool.pose], blend_m=0.01)
    poses, changes = [], 0
    with tool.group.follower.follow(motion.request(tool.group.joint_names)) as execution:
        next_change = random.integers(20, 120)
        while not execution.done:
            robot.step(1)
            position = robot.image.position_command[:6].tolist()
            named = dict(zip(tool.group.joint_names, position, strict=True))
            poses.append(urdf.pose(tool.kinematics.chain.link, named))
            if len(poses) >= next_change:
                change = random.choice(["pause", "resume", "slow", "full"])
                match change:
                    case "pause":
                        robot.axes.speed.pause()
                    case "resume":
                        robot.axes.speed.resume()
                    case "slow" | "full":
                        robot.axes.speed.set(0.2 if change == "slow" else 1.0)
                        robot.axes.speed.resume()
                changes += 1
                next_change += random.integers(10, 120)
            if changes == 25:
                robot.axes.speed.set(1.0)
                robot.axes.speed.resume()
    steps = pose_differences(np.array(poses[:-1]), np.array(poses[1:])) / period_s
    accelerations = np.diff(steps, axis=0) / period_s
    linear, angular = (
        np.linalg.norm(accelerations[:, part], axis=1) for part in (slice(0, 3), slice(3, 6))
    )
    assert changes > 5
    assert linear.max() < 1.05 * tool.speed.acceleration
    assert angular.max() < 1.05 * tool.speed.angular_acceleration
    assert execution.outcome is Outcome.SUCCEEDED


def test_outputs_are_set_at_their_places_of_the_path(robot: Robot, tool: RobotTool) -> None:
    """By the image of outputs of the simulation and the kinematics of the URDF reader."""
    period_s = 1.0 / robot.descriptor.cycle.rate_hz
    start = tool.pose[:3, 3]
    corner = tool.pose_relative(y=0.1)
    seen: dict[int, tuple[float, int]] = {}

    def look(image: ProcessImage) -> None:
        names = zip(tool.group.joint_names, image.position_command[:6].tolist(), strict=True)
        place = urdf.pose(tool.kinematics.chain.link, dict(names))[:3, 3]
        for bit in (0, 1, 2):
            if robot.io.output_bit(0, bit) and bit not in seen:
                seen[bit] = float(np.linalg.norm(place - start)), robot.clock.now_ns()

    urdf = read_urdf(robot.descriptor.urdf)
    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "look", look)
    before = PathOutput(0, 0, on=True, at_m=-0.03)
    earlier = PathOutput(0, 1, on=True, at_m=-0.03, at_s=0.05)
    at_corner = PathOutput(0, 2, on=True)
    line = Line(corner, outputs=(at_corner, earlier, before))
    tool.move_sequence(line, Line(tool.pose))
    speed = tool.speed.velocity
    assert seen[0][0] == pytest.approx(0.07, abs=3.0 * period_s * speed)
    assert (seen[1][1] - seen[0][1]) / 1e9 == pytest.approx(0.05, abs=2.0 * period_s)
    assert seen[2][0] == pytest.approx(0.1, abs=1e-3)
    with pytest.raises(InvalidArgument, match=r"segment 1, line: output 0\.0 at -0\.2 m and 0 s"):
        tool.plan_sequence([Line(corner, outputs=(PathOutput(0, 0, on=True, at_m=-0.2),))])


def test_bad_speeds_and_an_early_end(robot: Robot, tool: RobotTool) -> None:
    with pytest.raises(InvalidArgument, match=r"speed is 2, must be 0.01 to 1"):
        tool.plan_lines([tool.pose], speed=2.0)
    with pytest.raises(InvalidArgument, match="blend_m is -1"):
        tool.plan_lines([tool.pose], blend_m=-1.0)
    with pytest.raises(InvalidArgument, match="a line needs a pose"):
        tool.plan_lines([])
    robot.stop()
    with pytest.raises(OperationError):
        tool.move_line(tool.pose_relative(z=0.02))
    robot.reset()


def test_a_base_has_no_tool() -> None:
    base = build_robot("baymax", "sim")
    with pytest.raises(OperationError, match="the tool of baymax, which has no"):
        base.feature(ToolGroups)


def test_with_several_groups_one_has_to_be_named() -> None:
    groups = ToolGroups(build_robot("dual_cr3a", "sim", clock=SteppedClock()))
    with pytest.raises(InvalidArgument, match="several joint groups, left and right: name one"):
        _ = groups.only


def test_a_group_whose_tool_no_chain_moves_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Kinematics.of_descriptor

    def only_right(descriptor: RobotDescriptor, group: str, limits: JointLimits) -> Kinematics:
        if group == "left":
            raise DescriptorError("no joint moves the tool")
        return made(descriptor, group, limits)

    monkeypatch.setattr(Kinematics, "of_descriptor", only_right)
    groups = ToolGroups(build_robot("dual_cr3a", "sim", clock=SteppedClock()))
    assert groups.of("right").group.name == "right"
    with pytest.raises(DescriptorError, match="no joint moves the tool"):
        groups.of("left")
    with pytest.raises(InvalidArgument, match="group 'middle' is none of right"):
        groups.of("middle")


def test_a_sequence_rests_in_its_waits(robot: Robot, tool: RobotTool) -> None:
    start, there = tool.pose, tool.pose_relative(y=0.05)
    rests_ns = []

    def look(image: ProcessImage) -> None:
        measured = tool.measured_pose(image)
        if measured is not None and np.abs(measured - there).max() < 1e-5:
            rests_ns.append(robot.clock.now_ns())

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "look", look)
    robot.axes.speed.set(0.5)  # of motion: a wait takes its own time
    tool.move_sequence(Line(there, blend_m=0.02), Wait(time_s=1.5), Line(start))
    assert (rests_ns[-1] - rests_ns[0]) / 1e9 == pytest.approx(1.5, abs=0.4)
    assert tool.pose == pytest.approx(start, abs=1e-6)
    with pytest.raises(InvalidArgument, match=r"segment 2, wait: time_s is -1, must be above 0"):
        tool.move_sequence(Line(there), Wait(time_s=-1.0))
    with pytest.raises(InvalidArgument, match="segment 1, wait: a wait needs exactly one of"):
        tool.move_sequence(Wait(), Line(there))
    with pytest.raises(OperationError, match=r"segment 2, wait: input 0\.3 is not on after 0\.2 s"):
        tool.move_sequence(Line(there), Wait(input=(0, 3), timeout_s=0.2), Line(start))
    assert tool.pose == pytest.approx(there, abs=1e-6)


def test_a_stop_ends_a_wait(robot: Robot, tool: RobotTool) -> None:
    start = tool.pose

    def stop(image: ProcessImage) -> None:
        if robot.clock.now_ns() > began_ns + 500_000_000:
            robot.stop("by the operator")

    began_ns = robot.clock.now_ns()
    robot.control_loop.every(10.0, "stop", stop)
    with pytest.raises(OperationError, match=r"segment 1, wait: motion was stopped"):
        tool.move_sequence(Wait(time_s=10.0), Line(tool.pose_relative(z=0.05)))
    assert robot.clock.now_ns() < began_ns + 2_000_000_000
    assert tool.measured_pose() == pytest.approx(start, abs=1e-5)
