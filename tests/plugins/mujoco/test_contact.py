"""A program lowers the tool until it touches the table, and says how far it went on."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.plugins.mujoco.cell import CLOSED_M, LEFT_ABOVE, Cell, cell

from robotd import DescriptorError, OperationError
from robotd.events import EventKind
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

ABOVE = (0.0, *LEFT_ABOVE[1:])  # no cube is below
MAX_STOP_MM = 1.0


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cell]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with cell() as arm:
        arm.go(ABOVE, 3.0)
        arm.grip(closed=True)
        yield arm


def test_the_tool_is_lowered_until_it_touches_the_table(arm: Cell) -> None:
    programs = arm.robot.feature(Programs)
    down = "  - line: {by: {z: -0.2}, speed: 0.1, until: {torque: 5.0}}\n"
    programs.run(Program.parse(f"steps:\n{down}  - line: {{by: {{z: 0.02}}, speed: 0.5}}\n"))
    assert programs.state.state == "done"
    events, _ = arm.robot.events.since(0)
    told = [event.text for event in events if event.kind is EventKind.STATE]
    (text,) = [line for line in told if "at rest the tool" in line]
    assert "contact: the torque of joint2 has changed by -" in text
    match = re.search(r"at rest the tool ([0-9.]+) mm further", text)
    assert match is not None
    assert float(match[1]) < MAX_STOP_MM


def test_a_way_without_a_contact_stops_the_program(arm: Cell) -> None:
    programs = arm.robot.feature(Programs)
    up = Program.parse("steps:\n  - line: {by: {z: 0.05}, speed: 0.2, until: {torque: 30}}\n")
    with pytest.raises(OperationError, match=r"stopped at step 1.*; no contact: joint\d has ch"):
        programs.run(up)
    there = arm.robot.image.position.copy()
    with pytest.raises(OperationError, match="no contact"):
        programs.resume()  # it is at the end of its path, and stays there
    assert arm.robot.image.position == pytest.approx(there, abs=1e-3)
    assert arm.robot.gripper is not None
    assert arm.robot.gripper.position_m == pytest.approx(CLOSED_M, abs=5e-3)
    for torque, reason in (
        ("{elbow: 5}", r"steps\.0\.line\.until: unknown joint 'elbow'"),
        ("0", r"steps\.0\.line\.until\.torque.*must be greater than 0"),
        ("{}", r"steps\.0\.line\.until\.torque.*must have 1 or more items"),
    ):
        text = f"steps:\n  - line: {{by: {{z: 0.01}}, until: {{torque: {torque}}}}}\n"
        with pytest.raises(DescriptorError, match=reason):
            programs.check(Program.parse(text))
