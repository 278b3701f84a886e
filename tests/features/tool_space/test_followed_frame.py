"""Frames of the world: their tree, the estimate of a moving one, and the tool that follows it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.features.tool_space.arms import kinematics_of
from tests.features.tool_space.test_twist import PERIOD_S, READY, limits_of

from robotd.api import FloatArray, InvalidArgument, NotReady
from robotd.api.robots import MotionLimits
from robotd_tool_space.frames.followed_frame import FollowedFrame
from robotd_tool_space.geometry.rotations import inverse_pose, pose_differences, pose_of
from robotd_tool_space.geometry.transform_tree import Placed, TransformTree
from robotd_tool_space.streams.twist import Command, PoseCommand, ToolTwist, TwistStage

ARM = kinematics_of("cr3a")
SECOND = 1_000_000_000
ALONG = np.array([0.0, -0.05, 0.0])  # m/s
START = pose_of([0.1, -0.2, 0.3], [0.2, 0.0, 0.4])


def moving(time_s: float) -> FloatArray:
    """Frame on a conveyor."""
    pose = START.copy()
    pose[:3, 3] += time_s * ALONG
    return pose


def turning(time_s: float) -> FloatArray:
    """Frame on a turntable."""
    return pose_of([0.1, 0.0, 0.0], [0.0, 0.0, 0.2 * time_s])


class World:
    """A frame whose transforms arrive at 50 Hz, 20 ms after they were measured, while ``heard``."""

    def __init__(self, path: Callable[[float], FloatArray] = moving) -> None:
        self.time_s = 1.0
        self.heard = True
        self.shift = np.zeros(3)
        self.failures: list[str] = []
        self._path, self._period = path, 0
        placed = Placed(self.place(), SECOND, SECOND, frozenset({"belt"}))
        now = lambda: round(self.time_s * SECOND)  # noqa: E731
        self.frame = FollowedFrame("follow:belt", placed, now, ["link1"], self.failures.append)

    def place(self, age_s: float = 0.0) -> FloatArray:
        pose = self._path(self.time_s - age_s).copy()
        pose[:3, 3] += self.shift
        return pose

    def step(self) -> None:
        self.time_s += PERIOD_S
        self._period += 1
        if self.heard and self._period % 10 == 0:
            measured = round((self.time_s - 0.02) * SECOND)
            self.frame.take(Placed(self.place(0.02), measured, measured, frozenset({"belt"})))

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.step()


class FollowingTool:
    """Arm that executes a command while the world goes on."""

    def __init__(self, world: World, command: Command) -> None:
        self._world, rest = world, np.zeros_like(READY)
        self.stage = TwistStage(lambda: ARM, MotionLimits())
        self.stage.begin(np.array([READY, rest, rest]), limits_of(ARM), PERIOD_S)
        self.stage.take(command)
        self.setpoints = [np.array([READY, rest, rest])]

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self._world.step()
            self.setpoints.append(self.stage.advance())

    @property
    def pose(self) -> FloatArray:
        return ARM.forward(self.setpoints[-1][0])

    @property
    def in_frame(self) -> FloatArray:
        return inverse_pose(self._world.place()) @ self.pose

    def accelerations(self) -> FloatArray:
        """Of the tool, m/s²."""
        places = ARM.forward(np.array(self.setpoints)[:, 0])[:, :3, 3]
        return np.linalg.norm(np.diff(places, 2, axis=0), axis=1) / PERIOD_S**2


def test_a_frame_is_found_by_the_nearest_common_frame() -> None:
    tree = TransformTree()
    tree.put("map", "cell", pose_of([1.0, 0.0, 0.0]), None)
    tree.put("cell", "left/base", pose_of([0.0, 1.0, 0.0], [0.0, 0.0, np.pi / 2]), None)
    tree.put("cell", "belt", pose_of([0.0, 0.0, 0.5]), 7)
    tree.put("belt", "part", pose_of([0.1, 0.0, 0.0]), 5)
    placed = tree.find("left/base", "part")
    assert placed.pose == pytest.approx(
        pose_of([-1.0, -0.1, 0.5], [0.0, 0.0, -np.pi / 2]), abs=1e-12
    )
    assert (placed.oldest_ns, placed.newest_ns) == (5, 7)
    assert placed.passed == {"left/base", "cell", "belt", "part"}
    assert tree.find("part", "part").pose == pytest.approx(np.eye(4))


def test_a_frame_that_is_not_there_is_named_with_those_that_are() -> None:
    tree = TransformTree()
    tree.put("map", "base", np.eye(4), None)
    with pytest.raises(InvalidArgument, match=r"no transform of frame 'bas'; did you mean 'base'"):
        tree.find("base", "bas")
    with pytest.raises(InvalidArgument, match=r"\(received: base, map\)"):
        tree.find("base", "part")
    tree.put("camera", "part", np.eye(4), None)
    with pytest.raises(InvalidArgument, match="'part' is below 'camera', 'base' below 'map'"):
        tree.find("base", "part")
    tree.put("part", "camera", np.eye(4), None)  # a loop
    with pytest.raises(InvalidArgument, match="no transform between both frames"):
        tree.find("base", "part")


@pytest.mark.parametrize("path", [moving, turning])
def test_the_estimate_has_no_lag_behind_an_even_motion(path: Callable[[float], FloatArray]) -> None:
    world = World(path)
    world.pass_time(2.0)
    error = pose_differences(world.frame.pose, world.place())
    assert np.abs(error).max() < 1e-4
    motion = world.frame.motion()
    assert motion is not None
    place = np.array([0.5, 0.2, 0.3])
    carried = place - motion.pose[:3, 3]
    spin = np.array([0.0, 0.0, 0.2]) if path is turning else np.zeros(3)
    linear = np.cross(spin, carried) + (ALONG if path is moving else 0.0)
    assert motion.twist_at(place) == pytest.approx(np.concatenate([linear, spin]), abs=1e-3)


def test_a_tool_without_a_velocity_moves_with_the_frame() -> None:
    world = World()
    tool = FollowingTool(world, ToolTwist(np.zeros(6), frame=world.frame))
    tool.run(1.0)
    before = tool.in_frame
    tool.run(0.5)
    assert np.abs(pose_differences(before, tool.in_frame)).max() < 5e-4
    assert ARM.forward(READY)[1, 3] - tool.pose[1, 3] > 0.04


def test_a_velocity_is_along_the_axes_of_the_frame_and_from_it() -> None:
    world = World()
    tool = FollowingTool(world, ToolTwist(np.array([0, 0, 0.02, 0, 0, 0]), frame=world.frame))
    tool.run(1.0)
    before = tool.in_frame
    tool.run(0.5)
    displacement = pose_differences(before, tool.in_frame)
    assert displacement == pytest.approx([0.0, 0.0, 0.01, 0.0, 0.0, 0.0], abs=5e-4)


@pytest.mark.parametrize("path", [moving, turning])
def test_a_target_in_the_frame_is_reached_and_kept(path: Callable[[float], FloatArray]) -> None:
    world = World(path)
    target = inverse_pose(world.place()) @ ARM.forward(READY) @ pose_of([0.01, 0.02, -0.03])
    tool = FollowingTool(world, PoseCommand(target, world.frame))
    tool.run(3.0)
    for _ in range(5):
        tool.run(0.1)
        assert np.abs(pose_differences(target, tool.in_frame)).max() < 1e-3


@pytest.mark.parametrize("what", ["silence", "jump"])
def test_a_frame_that_is_lost_stops_the_tool_smoothly_and_for_good(what: str) -> None:
    world = World()
    target = inverse_pose(world.place()) @ ARM.forward(READY)
    tool = FollowingTool(world, PoseCommand(target, world.frame))
    tool.run(1.0)
    if what == "silence":
        world.heard = False
    else:
        world.shift = np.array([0.3, 0.0, 0.0])
    tool.run(1.0)
    assert world.frame.motion() is None
    expected = {
        "silence": "follow:belt: its transforms are 0.50 s old, at most 0.5 s",
        "jump": "follow:belt jumped by 300 mm and 0.00 rad, at most 50 mm and 0.1 rad",
    }[what]
    assert world.failures == [expected]
    assert not tool.setpoints[-1][1].any()  # at rest
    assert tool.accelerations().max() < 1.6  # the limit of the tool, and the curve of the arm
    rest = tool.pose
    world.heard, world.shift = True, np.zeros(3)
    tool.run(0.5)
    assert tool.pose == pytest.approx(rest)
    with pytest.raises(NotReady, match="choose the work frame again"):
        world.frame.require()


def test_a_shift_below_the_limit_of_a_jump_moves_the_tool_smoothly() -> None:
    world = World()
    target = inverse_pose(world.place()) @ ARM.forward(READY)
    tool = FollowingTool(world, PoseCommand(target, world.frame))
    tool.run(1.0)
    world.shift = np.array([0.03, 0.0, 0.0])
    tool.run(3.0)
    assert not world.failures
    assert np.abs(pose_differences(target, tool.in_frame)).max() < 1e-3
    assert tool.accelerations().max() < 1.6


def test_a_frame_that_the_arm_carries_is_not_followed() -> None:
    passed = frozenset({"base_link", "link1", "camera"})
    placed = Placed(np.eye(4), SECOND, SECOND, passed)
    with pytest.raises(NotReady, match=r"the arm itself moves it, with link1; tf:camera is where"):
        FollowedFrame("follow:camera", placed, lambda: SECOND, ["link1"], print)


def test_a_static_frame_has_no_age() -> None:
    placed = Placed(START, None, None, frozenset())
    frame = FollowedFrame("follow:table", placed, lambda: 3600 * SECOND, [], print)
    motion = frame.motion()
    assert motion is not None
    assert motion.pose == pytest.approx(START)
    assert not motion.twist.any()
