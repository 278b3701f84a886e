from __future__ import annotations

import io
import math

from rich.console import Console

from robotd.cli.status_view import view
from robotd.ros.client.live_status import LiveReport, PartReport
from robotd.ros.client.status_client import AxisReport, ToolReport


def shown(report: LiveReport) -> str:
    stream = io.StringIO()
    Console(file=stream, width=120).print(view(report))
    return stream.getvalue()


def axis(number: int, *, alarm: bool = False) -> AxisReport:
    return AxisReport(
        axis=number,
        servo_on=not alarm,
        alarm=alarm,
        home_done=False,
        home_switch=False,
        negative_limit=False,
        positive_limit=False,
        motion_complete=True,
        position_command=0.5,
        position=0.25,
        velocity=-0.1,
        torque=None,
    )


def test_axes_and_parts_are_shown_with_their_state() -> None:
    parts = (PartReport("joint3", 2, "amplifier alarm 34321"),)
    text = shown(LiveReport(True, (axis(0), axis(2, alarm=True)), parts, {"/arm": 1.25}))
    lines = text.splitlines()
    assert lines[0].startswith("ready")
    assert "1.2 s on its path" in lines[1]
    first, second = (line for line in lines if "+0.2500" in line)
    assert first.split() == ["0", "on", "-", "+0.2500", "-0.1000", "-", "+0.25000"]
    assert second.split()[:3] == ["2", "off", "ALARM"]
    assert "amplifier alarm 34321" in text


def test_goals_of_several_groups_are_shown_with_their_actions() -> None:
    lines = shown(
        LiveReport(True, (), (), {"/left/follow": 1.25, "/right/follow": 0.5})
    ).splitlines()
    assert "1.2 s on its path" in lines[1]
    assert lines[1].rstrip().endswith("/left/follow")
    assert "0.5 s on its path" in lines[2]
    assert lines[2].rstrip().endswith("/right/follow")


def test_a_robot_that_is_not_ready_has_no_axes() -> None:
    text = shown(LiveReport(False, None, (), {}))
    assert text.startswith("not ready")
    assert "on its path" not in text


def test_the_pose_of_each_tool_is_one_line() -> None:
    turned = (0.0, 0.0, math.pi / 2)
    half = math.sqrt(0.5)
    tools = tuple(
        ToolReport(link, "base_link", (0.1, -0.2, 0.3), turned, (0.0, 0.0, half, half))
        for link in ("left_tool", "right_tool")
    )
    text = shown(LiveReport(True, (axis(0),), (), {}, tools))
    left, right = (line for line in text.splitlines() if line.startswith("tool"))
    words = ["tool", "left_tool", "in", "base_link", "x", "+0.1000", "y", "-0.2000", "z", "+0.3000"]
    assert left.split()[: len(words)] == words
    assert "yaw +90.00°" in left
    assert "right_tool in base_link" in right
