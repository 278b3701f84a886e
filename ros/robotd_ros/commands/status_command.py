"""``robotd status``: show the state of a running robot."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.layout import columns, field, warning
from robotd.cli.options import as_json
from robotd.cli.preflight import import_ros
from robotd.stop_signals import Interrupt
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    check_watch,
    client_options,
    require_one_robot,
    robot_client,
)

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.status_client import AxisReport, RobotReport

REFRESH_HZ = 8


@click.command("status", epilog=ROS_EPILOG)
@as_json
@click.option("--watch", is_flag=True, help="Show the state as it changes, until Ctrl-C.")
@client_options
def status(*, as_json: bool, watch: bool, timeout_s: float) -> ExitCode:
    """Show connection, axes and tool pose of the running robot.

    The status is 1 when a fault or a stop forbids motion. Servos that are off and a speed of 0 %
    are shown as what stands in the way of motion; the status stays 0.
    """
    if watch:
        check_watch(as_json=as_json)
    return _watch(timeout_s) if watch else _status(timeout_s, as_json=as_json)


def _status(timeout_s: float, *, as_json: bool) -> ExitCode:
    """Print the state; OK when the robot takes motion commands, else FAILED."""
    with robot_client(timeout_s) as client:
        require_one_robot(client, prints=False)
        report = import_ros("robotd_ros.client.status_client").read_report(client)
    if as_json:
        click.echo(json.dumps(asdict(report, dict_factory=_without_nan), indent=2))
    else:
        click.echo(field("robot", [report.robot.text]))
        click.echo(field("engine", [f"{report.state}, {_readiness(report)}"]))
        for problem in report.problems:
            click.echo(field("problem", [*filter(None, (warning(str(problem)), problem.remedy))]))
        if report.speed != 1.0:
            click.echo(field("speed", [f"{100.0 * report.speed:g} %"]))
        if report.owners:
            click.echo(field("owners", [f"{name}: {who}" for name, who in report.owners.items()]))
        for label, levels in (("inputs", report.inputs), ("outputs", report.outputs)):
            if levels:
                click.echo(field(label, [f"{name}: {_level(on)}" for name, on in levels.items()]))
        for tool in report.tools:
            click.echo(field("tool", tool.lines))
        lines = ["not published"] if report.axes is None else _table(report.axes)
        click.echo(field("axes", lines))
    return ExitCode.OK if report.takes_motion else ExitCode.FAILED


def _without_nan(fields: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return fields with None for NaN, an unknown value: JSON has no NaN."""
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value
        for name, value in fields
    }


def _readiness(report: RobotReport) -> str:
    """Return the state in words; a robot that cannot move is never "ready"."""
    if not report.ready:
        return warning("not ready")
    if any(problem.prevents_motion for problem in report.problems):
        return warning("cannot move")
    outside = any(problem.kind == "outside limits" for problem in report.problems)
    return warning("ready, a joint is outside its limits") if outside else "ready"


def _level(on: bool | None) -> str:
    return "unknown" if on is None else "on" if on else "off"


def _watch(timeout_s: float) -> ExitCode:
    """Show the state until Ctrl-C; OK if the robot took motion commands then, else FAILED."""
    from rich.live import Live

    from robotd_ros.commands.status_watch_view import view

    with robot_client(timeout_s, searches=True) as client:
        require_one_robot(client, prints=False)
        live_status = import_ros("robotd_ros.client.live_status").live_status
        with Interrupt() as interrupt, live_status(client) as status:
            report = status.report()
            with Live(view(report), refresh_per_second=REFRESH_HZ) as screen:
                while not interrupt.happened:
                    client.spin()
                    report = status.report()
                    screen.update(view(report))
    return ExitCode.OK if report.takes_motion else ExitCode.FAILED


def _table(axes: Sequence[AxisReport]) -> list[str]:
    rows = [("axis", "name", "servo", "alarm", "position", "velocity", "torque", "switches")]
    for axis in axes:
        switches = [
            name
            for name, active in (
                ("-limit", axis.negative_limit),
                ("+limit", axis.positive_limit),
                ("home", axis.home_switch),
            )
            if active
        ]
        rows.append(
            (
                str(axis.axis),
                axis.name,
                "on" if axis.servo_on else "off",
                "ALARM" if axis.alarm else "-",
                f"{axis.position:+z.4f} {axis.unit}",
                f"{axis.velocity:+z.4f} {axis.unit}/s",
                axis.effort,
                ", ".join(switches) or "-",
            )
        )
    return columns(rows)
