"""Live view of a robot's state in the terminal, for ``robotd status --watch``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:  # it needs rclpy
    from robotd.control.groups.problem import Problem
    from robotd_ros.client.live_status import LiveReport

LEVELS = ("green", "yellow", "bold red", "dim")
BAR_WIDTH = 40


def view(report: LiveReport) -> Group:
    """Return the view of one state."""
    parts: list[RenderableType] = [_head(report), *map(_problem, report.problems)]
    for action, path_s in report.goals_s.items():
        line = Table.grid(padding=(0, 1))
        # Feedback has no duration: the bar moves, and the time on the path is beside it.
        bar = ProgressBar(total=None, pulse=True, width=BAR_WIDTH)
        name = [action] if len(report.goals_s) > 1 else []
        line.add_row(Text("goal", style="bold"), bar, f"{path_s:.1f} s on its path", *name)
        parts.append(line)
    parts.append(_axes(report))
    parts.append(_tools(report))
    parts.append(_parts(report))
    return Group(*parts)


def _head(report: LiveReport) -> Table:
    words = {True: "ready", False: "not ready", None: "no answer"}
    text, style = words[report.ready], "bold green" if report.ready else "bold red"
    if report.ready and any(problem.prevents_motion for problem in report.problems):
        text, style = "cannot move", "bold red"
    grid = Table.grid(padding=(0, 1))
    grid.add_row(Text(text, style=style), Text("stop with Ctrl-C", style="dim"))
    return grid


def _problem(problem: Problem) -> Text:
    return Text("; ".join(filter(None, (str(problem), problem.remedy))), style="yellow")


def _axes(report: LiveReport) -> Table:
    # Without padding at the edges six joints fit into 80 columns, a line each.
    columns = ("axis", "name", "servo", "alarm")
    table = Table(*columns, box=None, header_style="dim", pad_edge=False)
    for heading in ("position", "velocity", "torque", "following error"):
        table.add_column(heading, justify="right")
    for axis in report.axes or ():
        table.add_row(
            str(axis.axis),
            axis.name,
            Text("on", style="green") if axis.servo_on else Text("off", style="yellow"),
            Text("ALARM", style="bold red") if axis.alarm else "-",
            f"{axis.position:+z.4f} {axis.unit}",
            f"{axis.velocity:+z.4f} {axis.unit}/s",
            axis.effort,
            f"{axis.position_command - axis.position:+z.5f} {axis.unit}",
        )
    return table


def _tools(report: LiveReport) -> Table:
    grid = Table.grid(padding=(0, 2))
    for tool in report.tools:
        name, *pose = tool.lines
        grid.add_row(Text("tool", style="dim"), name, "\n".join(pose))
    return grid


def _parts(report: LiveReport) -> Table:
    """Return the parts of the diagnostics, the worst first.

    A terminal may be too low for all of them.
    """
    table = Table("part", "state", box=None, header_style="dim", pad_edge=False)
    for part in sorted(report.parts, key=lambda part: -part.level):
        style = LEVELS[min(part.level, len(LEVELS) - 1)]
        table.add_row(part.name, Text(part.message, style=style))
    return table
