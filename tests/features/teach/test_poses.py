"""Poses in a file, and the motion to them, on a stepped clock."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from robotd import DescriptorError, InvalidArgument, NotReady, OperationError, Robot, open_robot
from robotd.api.robots import SteppedClock
from robotd_shared.pose_file import HEAD, read_poses, write_poses
from robotd_teach.poses import Poses
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs
from robotd_tool_space.tool_groups import ToolGroups

BENT = {"joint1": 0.4, "joint2": -0.3, "joint3": 0.5, "joint4": 0.0, "joint5": 0.1, "joint6": 0.0}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "arm" / "robot.yaml"
    path.parent.mkdir()
    path.write_text("extends: cr3a\nname: arm\nposes: poses.yaml\n", encoding="utf-8")
    return path


@pytest.fixture
def robot(file: Path) -> Iterator[Robot]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture
def poses(robot: Robot) -> Poses:
    return robot.feature(Poses)


def positions(robot: Robot) -> list[float]:
    found: list[float] = robot.image.position[:6].tolist()
    return found


def test_a_pose_is_where_the_joints_are_and_is_gone_to(robot: Robot, poses: Poses) -> None:
    write_poses(poses.path, {"bent": BENT})
    poses.save("home")
    poses.go("bent", speed=1.0)
    assert positions(robot) == pytest.approx(list(BENT.values()), abs=2e-3)
    assert poses.save("here")["joint1"] == pytest.approx(0.4, abs=2e-3)
    poses.go("home")
    assert positions(robot) == pytest.approx([0.0] * 6, abs=2e-3)
    assert list(poses.all()) == ["bent", "home", "here"]


def test_the_file_is_in_the_robots_folder_and_is_read_anew(
    file: Path, robot: Robot, poses: Poses
) -> None:
    poses.save("home")
    path = file.parent / "poses.yaml"
    assert path.read_text(encoding="utf-8").startswith(HEAD)
    path.write_text(path.read_text(encoding="utf-8").replace("home", "rest"), encoding="utf-8")
    assert list(poses.all()) == ["rest"]


def test_without_the_key_they_are_in_the_folder_for_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        robot.feature(Poses).save("home")
    assert list(read_poses(tmp_path / "robotd" / "poses" / "cr3a.yaml")) == ["home"]


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_the_joints_keep_their_part_of_the_limits(robot: Robot, poses: Poses, speed: float) -> None:
    write_poses(poses.path, {"bent": BENT})
    rows: list[list[float]] = []
    robot.control_loop.every(
        robot.descriptor.cycle.rate_hz, "test", lambda image: rows.append(positions(robot))
    )
    poses.go("bent", speed)
    limits = robot.groups["joints"].follower.limits
    speeds = np.diff(rows, axis=0) * robot.descriptor.cycle.rate_hz
    fastest = np.abs(speeds).max(axis=0)
    assert (fastest <= 1.05 * speed * limits.velocity).all()
    assert (fastest / limits.velocity).max() > 0.3 * speed


@pytest.mark.parametrize(
    ("joints", "reason"),
    [
        (BENT | {"joint2": 9.0}, r"joint2 would be at 9 rad, its limits are -3\.14 to 3\.14 rad"),
        ({"joint1": 0.0}, "joint1 are not all joints of one group"),
        (BENT | {"elbow": 0.0}, "the robot has no joint elbow"),
    ],
)
def test_a_pose_that_a_changed_robot_has_made_invalid_says_so(
    robot: Robot, poses: Poses, joints: dict[str, float], reason: str
) -> None:
    write_poses(poses.path, {"old": joints})
    with pytest.raises(InvalidArgument, match=reason):
        poses.go("old")
    assert positions(robot) == pytest.approx([0.0] * 6, abs=1e-6)


TOOLS = """
tool_space:
  tools: {tip: {xyz_m: [0, 0, TIP]}}
  work_frames: {table: {xyz_m: [0.3, 0.0, 0.1]}}
"""


@contextmanager
def opened_with_tip(file: Path, tip_m: float) -> Iterator[Robot]:
    head = file.read_text(encoding="utf-8").split("tool_space")[0]
    file.write_text(head.rstrip() + TOOLS.replace("TIP", f"{tip_m}"), encoding="utf-8")
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        yield robot


def test_a_pose_keeps_that_of_the_tool_and_names_a_change_of_it(file: Path) -> None:
    with opened_with_tip(file, 0.1) as robot:
        poses, tool = robot.feature(Poses), robot.feature(ToolGroups).only
        write_poses(poses.path, {"start": BENT})
        poses.go("start", 1.0)
        tool.select_tool("tip")
        tool.select_work_frame("table")
        poses.save("bent")
        kept = poses.tool_poses()["bent"]
        assert (kept.tool, kept.work_frame) == ("tip", "table")
        assert [kept.x, kept.y, kept.z] == pytest.approx(tool.pose[:3, 3].tolist(), abs=2e-3)
        poses.rename("bent", "pick")
        assert [*poses.tool_poses()] == ["pick"]
    with opened_with_tip(file, 0.1005) as robot:  # within what counts as the same
        assert robot.feature(Poses).problems() == {"start": "", "pick": ""}
    with opened_with_tip(file, 0.15) as robot:
        poses = robot.feature(Poses)
        assert poses.problems()["start"] == ""
        changed = r"tip would be 50\.0 mm and 0\.000 rad from where it was saved"
        with pytest.raises(InvalidArgument, match=changed):
            poses.go("pick")
        program = Program.parse("steps: [{move: {pose: pick}}]\n")
        with pytest.raises(DescriptorError, match=f"pose pick cannot be gone to: {changed}"):
            robot.feature(Programs).run(program)
        assert positions(robot) == pytest.approx([0.0] * 6, abs=1e-6)
    file.write_text(file.read_text(encoding="utf-8").replace("tip:", "pin:"), encoding="utf-8")
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        assert "unknown tool 'tip'" in robot.feature(Poses).problems()["pick"]
        robot.feature(Poses).delete("pick")
        assert not robot.feature(Poses).tool_poses()


def test_the_tool_goes_to_a_pose_on_a_line(robot: Robot, poses: Poses) -> None:
    above = BENT | {"joint2": -0.4, "joint3": 1.4, "joint5": 1.0}
    write_poses(poses.path, {"above": above, "end": above | {"joint1": 1.2, "joint2": -0.3}})
    poses.go("above", 1.0)
    kinematics = robot.feature(ToolGroups).only.kinematics
    rows: list[list[float]] = []
    robot.control_loop.every(500, "test", lambda image: rows.append(positions(robot)))
    poses.go("end", 1.0, line=True)
    assert positions(robot) == pytest.approx(list(poses.known("end").values()), abs=2e-3)
    places = kinematics.forward(np.array(rows))[:, :3, 3]
    displacement = places[-1] - places[0]
    beside = np.cross(places - places[0], displacement / np.linalg.norm(displacement))
    assert np.linalg.norm(displacement) > 0.05
    assert np.linalg.norm(beside, axis=1).max() < 1e-3


def test_names_are_checked(poses: Poses) -> None:
    poses.save("home")
    poses.save("home", replace=True)
    with pytest.raises(InvalidArgument, match="there is a pose 'home' already"):
        poses.save("home")
    with pytest.raises(InvalidArgument, match="'a b' is not a valid name of a pose"):
        poses.save("a b")
    with pytest.raises(InvalidArgument, match=r"unknown pose 'hom'; did you mean 'home'\?"):
        poses.go("hom")
    poses.save("pick")
    with pytest.raises(InvalidArgument, match="there is a pose 'home' already"):
        poses.rename("pick", "home")
    poses.rename("home", "ready")
    poses.delete("pick")
    assert list(poses.all()) == ["ready"]
    with pytest.raises(InvalidArgument, match=r"speed is 2, must be 0\.01 to 1"):
        poses.go("ready", 2.0)


def test_a_stop_ends_the_way_to_a_pose_and_the_next_one_needs_a_reset(
    robot: Robot, poses: Poses
) -> None:
    write_poses(poses.path, {"bent": BENT})

    def stop(image: object) -> None:
        if positions(robot)[0] > 0.1 and not robot.axes.stop_latch.cause:
            robot.axes.stop_latch.engage("by the test")

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "test", stop)
    with pytest.raises(OperationError, match="the motion to bent ended early"):
        poses.go("bent")
    assert 0.1 < positions(robot)[0] < 0.35
    with pytest.raises(NotReady, match="by the test"):
        poses.go("bent")


def test_a_file_that_is_wrong_is_named_with_its_line(poses: Poses) -> None:
    poses.path.write_text("poses:\n  home: {joint1: far}\n", encoding="utf-8")
    with pytest.raises(DescriptorError, match=r"poses\.yaml:2: poses\.home\.joint1"):
        poses.all()


def test_of_several_groups_one_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with open_robot("dual_cr3a", "sim", clock=SteppedClock()) as robot:
        poses = robot.feature(Poses)
        with pytest.raises(InvalidArgument, match="name one of the joint groups left, right"):
            poses.save("home")
        poses.save("home", "left")
        poses.go("home")
