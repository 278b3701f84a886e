"""Jog and moves of a tool on the simulated clock: along its axis, and no longer than held."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Literal

import numpy as np
import pytest
from tests.features.page.server.viewer import TIMEOUT_S as PATIENCE_S
from tests.features.page.server.viewer import wait_until

from robotd import Robot, open_robot
from robotd.api import FloatArray
from robotd.clock.simulated import PacedClock, SteppedClock
from robotd.motion import TrajectoryRequest
from robotd_page.control_jog import jog_velocities
from robotd_page.control_target import HeldMove, MoveTool, Reach, reach
from robotd_page.control_tool import HeldTool, JogTool, describe_tools
from robotd_page.held_motion import HEARTBEAT_S, RELEASED, TIMEOUT_S, JogEnd
from robotd_tool_space import ToolGroups
from robotd_tool_space.paths.tool_motion import ToolMotion

BENT = [0.3, -0.6, 1.6, -0.3, 1.2, 0.0]
AT_REST = 1e-3  # rad/s
STOP_S = 0.3  # from the last heartbeat to rest
NO_MOTION = (0.0, 0.0, 0.0)

Vector = tuple[float, float, float]


class Client:
    """Page that holds a button of the tool's pad, in stepped time."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tool = robot.feature(ToolGroups).only
        self.ended: list[JogEnd] = []
        self.notes: list[str] = []
        self.workers = ThreadPoolExecutor(2)
        self.held = HeldTool(
            robot.feature(ToolGroups),
            robot,
            "page 1",
            self.workers,
            self.ended.append,
            on_note=lambda hold, note: self.notes.append(note),
        )
        self.hold = 0
        self.fastest = np.zeros(6)

    def move(self, positions: list[float]) -> None:
        request = TrajectoryRequest.from_rows(self.robot.joint_names, [1.5], [positions])
        with self.robot.follower.follow(request) as goal:
            while goal.outcome is None:
                self.robot.step(10)

    def press(
        self,
        linear: Vector = NO_MOTION,
        angular: Vector = NO_MOTION,
        frame: Literal["base", "tool"] = "base",
        seconds: float = 0.5,
    ) -> None:
        """Hold a button, and keep it held."""
        self.hold += 1
        beat = self.beat(linear, angular, frame)
        count = len(self.ended)
        self.held.beat(beat)
        wait_until(lambda: len(self.ended) > count or self._is_open())
        for _ in range(round(seconds / HEARTBEAT_S)):
            self.held.beat(beat)
            self.run(HEARTBEAT_S)

    def beat(
        self, linear: Vector, angular: Vector = NO_MOTION, frame: Literal["base", "tool"] = "base"
    ) -> JogTool:
        return JogTool(
            type="jog_tool",
            hold=self.hold,
            group=self.tool.group.name,
            frame=frame,
            linear=linear,
            angular=angular,
        )

    def run(self, seconds: float) -> None:
        self.robot.step(round(seconds * self.robot.descriptor.cycle.rate_hz))
        self.fastest = np.maximum(self.fastest, np.abs(self.robot.image.velocity[:6]))

    def end(self) -> JogEnd:
        wait_until(lambda: self.ended and self.ended[-1].hold == self.hold)
        return self.ended[-1]

    @property
    def pose(self) -> FloatArray:
        pose = self.tool.measured_pose()
        assert pose is not None
        return pose

    @property
    def is_at_rest(self) -> bool:
        return bool(np.abs(self.robot.image.velocity[:6]).max() < AT_REST)

    def _is_open(self) -> bool:
        hold = self.held._hold
        return hold is not None and hold.motion is not None


@pytest.fixture(scope="module")
def robot() -> Iterator[Robot]:
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture
def client(robot: Robot) -> Iterator[Client]:
    client = Client(robot)
    client.move(BENT)
    yield client
    client.held.close()
    robot.step(500)
    client.workers.shutdown()


@pytest.mark.parametrize("frame", ["base", "tool"])
def test_a_tool_moves_along_an_axis_while_heartbeats_arrive(
    client: Client, frame: Literal["base", "tool"]
) -> None:
    before = client.pose
    client.press((0.0, 0.0, -0.03), frame=frame, seconds=1.0)
    assert client.robot.axes.owner(1) == "page 1"
    client.held.release(client.hold, RELEASED)
    client.run(STOP_S)
    assert client.is_at_rest
    assert client.end() == JogEnd(1, True, False, RELEASED)
    moved = client.pose[:3, 3] - before[:3, 3]
    axis = before[:3, 2] if frame == "tool" else np.array([0.0, 0.0, 1.0])
    assert moved @ axis == pytest.approx(-0.03, abs=0.006)
    assert np.linalg.norm(moved - (moved @ axis) * axis) < 1e-3
    assert client.pose[:3, :3] == pytest.approx(before[:3, :3], abs=1e-3)


def test_a_tool_as_fast_as_can_be_says_why_it_is_not_faster_and_rests_after_a_silence(
    client: Client,
) -> None:
    client.press((9.0, 0.0, 0.0), (0.0, 0.0, 9.0), seconds=0.6)
    client.run(STOP_S - HEARTBEAT_S)
    assert client.is_at_rest
    assert client.end() == JogEnd(1, False, True, f"no command for {TIMEOUT_S:g} s")
    highest = [jog_velocities(client.robot)[name] for name in client.robot.joint_names]
    assert (client.fastest < 1.05 * np.array(highest)).all()
    assert any("would exceed its velocity limit" in note for note in client.notes)


def test_a_stop_ends_the_hold_and_heartbeats_move_nothing_after_it(client: Client) -> None:
    client.press((0.03, 0.0, 0.0))
    client.robot.axes.stop_latch.engage("by hand")
    client.run(STOP_S)
    assert client.is_at_rest
    assert "by hand" in client.end().reason
    client.robot.reset()
    rests = client.pose
    client.held.beat(client.beat((0.03, 0.0, 0.0)))
    client.run(0.2)
    assert client.pose == pytest.approx(rests, abs=1e-5)


def test_rejections(client: Client) -> None:
    client.press()
    assert client.end().reason == "the jog velocity of the tool is 0"
    described = describe_tools(client.robot.feature(ToolGroups))
    assert [(tool["link"], tool["axes"]) for tool in described] == [("link6", [0, 1, 2, 3, 4, 5])]
    assert describe_tools({}) == []


def posture(robot: Robot, pose: FloatArray | None, *, is_final: bool = True) -> dict[str, Any]:
    numbers = None if pose is None else tuple(pose.T.ravel().tolist())
    tools = robot.feature(ToolGroups)
    group = tools.only.group.name
    question = Reach(type="reach", id=1, group=group, pose=numbers, is_final=is_final)
    return reach(robot, tools, question)


def test_the_posture_of_a_target_or_why_there_is_none(client: Client) -> None:
    here = posture(client.robot, None)
    assert [*here["joints"].values()] == pytest.approx(BENT, abs=1e-3)
    pose = np.array(here["pose"]).reshape(4, 4).T
    assert pose == pytest.approx(client.pose, abs=1e-9)
    pose[2, 3] -= 0.05
    for is_final in (False, True):
        joints = posture(client.robot, pose, is_final=is_final)["joints"]
        reached = client.tool.kinematics.forward(np.array([*joints.values()]))
        assert reached == pytest.approx(pose, abs=1e-5)
    pose[0, 3] += 3.0
    answer = posture(client.robot, pose)
    assert answer["joints"] is None
    assert "out of reach" in answer["text"]


def test_a_move_from_before_a_stop_moves_nothing(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, tool, before = client.robot, client.tool, client.pose
    plan_move = tool.plan_move

    def stopped(pose: FloatArray, speed: float = 1.0) -> ToolMotion:
        motion = plan_move(pose, speed)
        robot.stop()
        robot.reset()
        return motion

    monkeypatch.setattr(tool, "plan_move", stopped)
    held = HeldMove(robot.feature(ToolGroups), robot, "page 1", client.workers, client.ended.append)
    target = before.copy()
    target[2, 3] -= 0.05
    numbers = tuple(target.T.ravel().tolist())
    group = tool.group.name
    held.beat(
        MoveTool(type="move_tool", hold=1, group=group, pose=numbers, line=False, velocity=0.1)
    )
    wait_until(lambda: client.ended)
    assert client.ended[0].reason == "motion was stopped before this one began"
    client.run(0.2)
    assert client.pose == pytest.approx(before, abs=1e-6)


@pytest.mark.parametrize("ends", ["reached", "released", "silent"])
def test_a_move_goes_on_while_heartbeats_arrive(ends: str) -> None:
    with open_robot("cr3a", "sim", clock=PacedClock(1.0)) as robot:
        tool = robot.feature(ToolGroups).only
        request = TrajectoryRequest.from_rows(robot.joint_names, [1.0], [BENT])
        with robot.follower.follow(request) as goal:
            assert goal.wait(PATIENCE_S)
        ended: list[JogEnd] = []
        workers = ThreadPoolExecutor(1)
        timeout_s = 0.2 if ends == "silent" else 600.0
        held = HeldMove(
            robot.feature(ToolGroups), robot, "page 1", workers, ended.append, timeout_s
        )
        start, distance_m = tool.pose, 0.02 if ends == "reached" else 0.2
        target = start.copy()
        target[2, 3] -= distance_m
        numbers = tuple((tool.work_frame @ target).T.ravel().tolist())
        beat = MoveTool(
            type="move_tool", hold=1, group=tool.group.name, pose=numbers, line=True, velocity=0.1
        )
        held.beat(beat)
        wait_until(lambda: ended or np.abs(robot.image.velocity).max() > 0.01)
        if ends == "released":
            held.release(1, "window lost focus")
        wait_until(lambda: ended)
        workers.shutdown()
        expected = {"reached": "reached", "released": "window lost focus"}
        (end,) = ended
        assert end.what == "Move"
        assert end.reason == expected.get(ends, "heartbeats did not come")
        assert (end.is_wanted, end.is_silent) == (ends == "reached", ends == "silent")
        assert not tool.group.motion.moving
        moved_m = start[2, 3] - tool.pose[2, 3]
        assert (
            moved_m == pytest.approx(distance_m, abs=1e-4) if ends == "reached" else moved_m < 0.19
        )
