from __future__ import annotations

import io
import math

from rich.console import Console

from robotd.control.groups.problem import Problem, ProblemKind
from robotd_ros.client.live_status import LiveReport, PartReport
from robotd_ros.client.status_client import AxisReport, ToolReport
from robotd_ros.commands.status_watch_view import view


def shown(report: LiveReport) -> str:
    stream = io.StringIO()
    Console(file=stream, width=80).print(view(report))
    return stream.getvalue()


def axis(
    number: int,
    *,
    alarm: bool = False,
    unit: str = "rad",
    torque: float | None = None,
    position: float = 0.25,
) -> AxisReport:
    return AxisReport(
        axis=number,
        name=f"joint{number + 1}",
        unit=unit,
        servo_on=not alarm,
        alarm=alarm,
        home_done=False,
        home_switch=False,
        negative_limit=False,
        positive_limit=False,
        motion_complete=True,
        position_command=0.5,
        position=position,
        velocity=-0.1,
        torque=torque,
    )


def test_axes_and_parts_are_shown_with_their_state() -> None:
    parts = (PartReport("joint3", 2, "amplifier alarm 34321"),)
    text = shown(LiveReport(True, (axis(0), axis(2, alarm=True)), parts, {"/arm": 1.25}))
    lines = text.splitlines()
    assert lines[0].startswith("ready")
    assert "1.2 s on its path" in lines[1]
    first, second = (line for line in lines if "+0.2500" in line)
    assert first.split()[:6] == ["0", "joint1", "on", "-", "+0.2500", "rad"]
    assert first.split()[6:] == ["-0.1000", "rad/s", "-", "+0.25000", "rad"]
    assert second.split()[:4] == ["2", "joint3", "off", "ALARM"]
    assert "amplifier alarm 34321" in text


def test_what_keeps_axes_from_moving_is_shown_with_its_remedy() -> None:
    reason, remedy = "amplifier alarm 17 (overload)", "robotd recover"
    alarm = Problem(ProblemKind.ALARM, reason, ("joint3",), 17, remedy)
    report = LiveReport(True, (axis(2, alarm=True),), (), {}, problems=(alarm,))
    assert not report.takes_motion
    lines = shown(report).splitlines()
    assert lines[0].startswith("cannot move")
    assert lines[1].startswith("joint3: amplifier alarm 17 (overload); robotd recover")


def test_a_robot_that_is_not_ready_says_so_before_what_else_hinders_it() -> None:
    stopped = Problem(ProblemKind.STOPPED, "all motion stopped", remedy="robotd reset")
    for ready, word in ((False, "not ready"), (True, "cannot move")):
        lines = shown(LiveReport(ready, (), (), {}, problems=(stopped,))).splitlines()
        assert lines[0].startswith(word)


def test_settings_of_a_client_do_not_forbid_motion() -> None:
    settings = (
        Problem(ProblemKind.SERVO_OFF, "servo off", ("joint1",)),
        Problem(ProblemKind.PAUSED, "motion is paused"),
    )
    assert LiveReport(True, (), (), {}, problems=settings).takes_motion


def test_a_client_that_has_to_be_released_is_shown_and_the_robot_is_ready() -> None:
    source = Problem(ProblemKind.SOURCE, "wmx/axis/jog kept commanding: release it")
    report = LiveReport(True, (), (), {}, problems=(source,))
    assert report.takes_motion
    first, second, *_ = shown(report).splitlines()
    assert first.startswith("ready")
    assert second.startswith("wmx/axis/jog kept commanding")


def test_a_prismatic_axis_is_in_m_and_n() -> None:
    text = shown(LiveReport(True, (axis(0, unit="m", torque=12.0),), (), {}))
    line = next(line for line in text.splitlines() if "joint1" in line)
    assert line.split()[4:] == ["+0.2500", "m", "-0.1000", "m/s", "+12.00", "N", "+0.25000", "m"]


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


def test_six_moving_joints_take_a_line_each_in_80_columns() -> None:
    axes = tuple(axis(number, torque=-2.5) for number in range(6))
    lines = shown(LiveReport(True, axes, (), {})).splitlines()
    assert [line.split()[1] for line in lines if "N·m" in line] == [axis.name for axis in axes]
    assert not [line for line in lines if line.strip() in ("rad", "rad/s", "N·m")]


def test_the_parts_with_problems_come_first() -> None:
    parts = tuple(PartReport(name, level, "text") for name, level in (("a", 0), ("b", 2), ("c", 0)))
    lines = shown(LiveReport(True, (), parts, {})).splitlines()
    assert [line.split()[0] for line in lines if "text" in line] == ["b", "a", "c"]


def test_the_pose_of_each_tool_fits_into_80_columns() -> None:
    turned = (0.0, 0.0, math.pi / 2)
    half = math.sqrt(0.5)
    tools = tuple(
        ToolReport(link, "base_link", (0.1, -0.2, 0.3), turned, (0.0, 0.0, half, half))
        for link in ("left_tool", "right_tool")
    )
    text = shown(LiveReport(True, (axis(0),), (), {}, tools))
    lines = text.splitlines()
    left, right = (line for line in lines if line.startswith("tool"))
    words = ["tool", "left_tool", "in", "base_link", "x", "+0.1000", "y", "-0.2000", "z", "+0.3000"]
    assert left.split()[: len(words)] == words
    assert lines[lines.index(left) + 1].strip() == "roll +0.00  pitch +0.00  yaw +90.00°"
    assert "right_tool in base_link" in right
