"""Segments of a sequence that end at a force; MuJoCo's own data judge them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.plugins.mujoco.cell import Cell, cell
from tests.plugins.mujoco.test_force_contact import ABOVE, Truth

from robotd import InvalidArgument
from robotd.api import FloatArray
from robotd.api.robots import ContactLimits, Outcome, WrenchLimits
from robotd_tool_space.geometry.rotations import fill_pose
from robotd_tool_space.paths.segments import Line, SequenceStep, Wait
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.sequences.sequence_run import SequenceRun
from robotd_tool_space.tool_groups import ToolGroups

LIMIT_N = 10.0


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cell]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with cell() as arm:
        arm.go(ABOVE, 3.0)
        arm.grip(closed=True)
        yield arm


@pytest.fixture
def tool(arm: Cell) -> RobotTool:
    return arm.robot.feature(ToolGroups).only


def press(arm: Cell, tool: RobotTool, axis: str = "+z") -> WrenchLimits:
    sensor = arm.robot.wrenches.of(tool.group.name)
    return WrenchLimits(sensor, LIMIT_N, axis=tool.wrench_axis(sensor, axis))


def begin(tool: RobotTool, *steps: Line | Wait) -> SequenceRun:
    return tool.sequence(tool.plan_parts(steps), tool.arrive())


def test_what_follows_a_contact_begins_there(arm: Cell, tool: RobotTool) -> None:
    truth, poses, at = Truth(arm), list[FloatArray](), tool.pose_relative
    aside, until = at(y=0.05), press(arm, tool)
    steps = (
        Line(at(z=-0.02), blend_m=0.01, speed=0.2),
        Line(at(z=-0.3), speed=0.1, until=until, blend_m=0.01),
        Wait(time_s=0.1),
        Line(aside, speed=0.3),
    )
    run = begin(tool, *steps)

    def tick() -> None:
        pose = tool.measured_pose()
        assert pose is not None
        if run.progress().segment == 3:
            poses.append(pose)

    outcome, message = run.run(tick)
    assert outcome is Outcome.SUCCEEDED, message
    highest = max(force for force, _ in truth.samples)
    assert LIMIT_N < highest < 100.0
    assert run.progress().segment == len(steps)
    touched = poses[0][2, 3]
    assert aside[2, 3] - 0.29 < touched < aside[2, 3] - 0.03, "on the table, not at the target"
    assert tool.pose == pytest.approx(aside, abs=1e-4)
    assert truth.force() == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_segment_without_a_contact_ends_the_sequence(arm: Cell, tool: RobotTool) -> None:
    there, beyond = tool.pose_relative(z=0.05), tool.pose_relative(z=0.1)
    run = begin(tool, Line(there, until=press(arm, tool)), Line(beyond))
    outcome, message = run.run()
    assert outcome is Outcome.STOPPED
    assert "no contact: the force at link6 along +z of the base has changed by" in message
    assert (run.progress().segment, run.progress().segments) == (1, 2)
    assert tool.pose == pytest.approx(there, abs=1e-4)


def test_a_torque_of_a_joint_ends_a_segment(arm: Cell, tool: RobotTool) -> None:
    until = ContactLimits(np.full(len(tool.group.joint_names), 5.0))
    above, down = tool.pose, tool.pose_relative(z=-0.3)
    tool.move_sequence(Line(down, speed=0.1, until=until), Line(above))
    assert tool.pose == pytest.approx(above, abs=1e-4)


def test_what_cannot_follow_from_the_contact_ends_the_sequence(
    arm: Cell, tool: RobotTool, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = begin(
        tool, Line(tool.pose_relative(z=-0.3), speed=0.1, until=press(arm, tool)), Line(tool.pose)
    )

    def reject(*_: object) -> None:
        raise InvalidArgument("not from here")

    monkeypatch.setattr(tool, "plan_rest", reject)
    outcome, message = run.run()
    assert outcome is Outcome.STOPPED
    assert message.startswith("segment 1: contact: the force at link6 along +z of the base")
    assert message.endswith("what follows cannot be executed from there: not from here")
    assert run.progress().segment == 1


@pytest.mark.parametrize("while_planned", [False, True])
def test_what_is_appended_follows_from_the_contact(
    arm: Cell, tool: RobotTool, monkeypatch: pytest.MonkeyPatch, while_planned: bool
) -> None:
    above, down = tool.pose, tool.pose_relative(z=-0.3)
    run = begin(tool, Line(down, speed=0.1, until=press(arm, tool)), Line(above))
    appended: list[bool] = []

    def append() -> None:
        if not appended and (while_planned or run.progress().part > 0.1):
            appended.append(run.append([Line(down, speed=0.1, until=press(arm, tool))]))
            appended.append(run.append([Line(above)]))

    plan_rest = tool.plan_rest

    def planned(*arguments: object) -> object:
        parts = plan_rest(*arguments)  # type: ignore[arg-type]
        append()
        return parts

    if while_planned:
        monkeypatch.setattr(tool, "plan_rest", planned)
    outcome, message = run.run((lambda: None) if while_planned else append)
    assert outcome is Outcome.SUCCEEDED, message
    assert appended == [False, False]
    assert run.progress().segment == 4
    assert tool.pose == pytest.approx(above, abs=1e-4)


def test_what_is_planned_behind_the_target_is_planned_anew_after_a_contact(
    arm: Cell, tool: RobotTool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The contact comes while it is planned, and it is appended before the sequence ends."""
    above = tool.pose
    run = begin(tool, Line(tool.pose_relative(z=-0.3), speed=0.1, until=press(arm, tool)))
    planned, contact = threading.Event(), threading.Event()
    thread = threading.Thread(target=run.append, args=([Line(above)],))
    plan_behind, advance = tool.plan_behind, run._next

    def plan(*arguments: object) -> object:
        parts = plan_behind(*arguments)  # type: ignore[arg-type]
        planned.set()
        assert contact.wait(30.0)
        return parts

    def advance_after_append() -> object:
        if planned.is_set():
            contact.set()
            thread.join(30.0)
        return advance()

    def tick() -> None:
        if not planned.is_set() and not thread.is_alive():
            thread.start()
            assert planned.wait(30.0)

    monkeypatch.setattr(tool, "plan_behind", plan)
    monkeypatch.setattr(run, "_next", advance_after_append)
    outcome, message = run.run(tick)
    assert outcome is Outcome.SUCCEEDED, message
    assert run.progress().segments == 2
    assert tool.pose == pytest.approx(above, abs=1e-4)


def test_a_message_of_a_segment_until_a_force(arm: Cell, tool: RobotTool) -> None:
    messages = pytest.importorskip("robotd_msgs.msg", reason="no ROS in this environment")
    geometry = pytest.importorskip("geometry_msgs.msg")
    nodes = pytest.importorskip("robotd_tool_space.nodes.sequence_services")
    above, down = tool.pose, tool.pose_relative(z=-0.3)

    def steps(**fields: object) -> list[SequenceStep]:
        message = messages.MotionSegment(kind=messages.MotionSegment.LINE, speed=0.1)
        message.poses = [geometry.Pose()]
        fill_pose(message.poses[0], down)
        for name, value in fields.items():
            setattr(message, name, value)
        found: list[SequenceStep] = nodes.steps_of([message], arm.robot, tool)
        return found

    assert isinstance(plain := steps()[0], Line)
    assert plain.until is None
    tool.move_sequence(
        *steps(until_force_n=LIMIT_N, until_axis="-z", until_frame="tool"), Line(above)
    )
    assert tool.pose == pytest.approx(above, abs=1e-4)
    (torque,) = steps(until_torque_nm=2.0, until_as_reported=True)
    assert isinstance(torque, Line)
    assert isinstance(until := torque.until, WrenchLimits)
    assert (until.force_n, until.torque_nm) == (np.inf, 2.0)
    assert (until.bias, until.axis) == (False, None)
    for text, fields in {
        "segment 1: force_n is -1, must be above 0": {"until_force_n": -1.0},
        "segment 1: force_n is nan, must be above 0": {"until_force_n": np.nan},
        "segment 1: a contact by wrench needs force_n or torque_nm": {"until_axis": "z"},
        "segment 1: until_frame belongs to until_axis": {"until_frame": "tool"},
        "segment 1: axis 'up' of 'base' must be": {"until_force_n": 1.0, "until_axis": "up"},
        "segment 1: a wait does not end at a contact": {
            "kind": messages.MotionSegment.WAIT,
            "until_force_n": 1.0,
        },
    }.items():
        with pytest.raises(InvalidArgument, match=text):
            steps(**fields)


def test_contacts_that_cannot_be_are_rejected(arm: Cell, tool: RobotTool) -> None:
    line = Line(tool.pose_relative(z=-0.1), until=press(arm, tool))
    with pytest.raises(InvalidArgument, match="constant speed has no segment with until"):
        tool.move_sequence(line, constant_speed=True)
    with pytest.raises(InvalidArgument, match="belongs to move_sequence"):
        tool.plan_sequence([line])
    with pytest.raises(InvalidArgument, match="axis 'up' of 'base' must be one of x, y, z"):
        press(arm, tool, "up")
