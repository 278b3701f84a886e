"""``robotd list``: the running robots of the ROS domain."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from robotd.cli.layout import columns, warn, warning
from robotd.cli.options import as_json
from robotd.cli.preflight import import_ros
from robotd.stop_signals import Interrupt
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    check_watch,
    client_options,
    robot_client,
)

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.fleet import Fleet, FleetRobot

SETTLE_S = 1.0  # for the discovery of what runs
REFRESH_S = 0.5
HEADER = (
    *("robot", "namespace", "backend", "computer", "state", "owner", "up", "robotd", ""),
    "problem",
)


@click.command("list", epilog=ROS_EPILOG)
@as_json
@click.option("--watch", is_flag=True, help="Show the robots as they change, until Ctrl-C.")
@client_options
def list_robots(timeout_s: float, *, as_json: bool, watch: bool) -> None:
    """List the running robots of the ROS domain with their state.

    The status is 0 whatever the robots' states are.
    """
    if watch:
        check_watch(as_json=as_json)
    with robot_client(timeout_s, searches=True) as client:
        fleet = import_ros("robotd_ros.client.fleet")
        if watch:
            _watch(fleet.Fleet(client))
            return
        robots, is_sure = fleet.find_robots(client, SETTLE_S)
    if not is_sure:
        warn(f"after {timeout_s:g} s robots are still being discovered: give a longer --timeout")
    if as_json:
        click.echo(json.dumps([robot.json for robot in robots], indent=2))
    elif robots:
        click.echo("\n".join(robot_lines(robots)))
    else:
        click.echo("no robot runs in this ROS domain", err=True)


def robot_lines(robots: Sequence[FleetRobot]) -> list[str]:
    """Return the table of robots; the first problem of each is its last column."""
    rows = [HEADER]
    for robot in robots:
        identity = robot.identity
        rows.append(
            (
                identity.robot,
                identity.namespace,
                identity.backend,
                identity.computer,
                robot.state,
                ", ".join(robot.owners) or "-",
                duration(robot.uptime_s),
                identity.version,
                "SIMULATED" if identity.simulated else "",
                robot.problems[0] if robot.problems else "",
            )
        )
    return columns(rows)


def duration(seconds: float) -> str:
    """Return a time of operation in its two largest units: ``3 d 4 h``."""
    minutes, left_s = divmod(round(seconds), 60)
    hours, left_min = divmod(minutes, 60)
    days, left_h = divmod(hours, 24)
    if days:
        return f"{days} d {left_h} h"
    if hours:
        return f"{hours} h {left_min} min"
    return f"{minutes} min {left_s} s" if minutes else f"{left_s} s"


def _watch(fleet: Fleet) -> None:
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    due_s = 0.0
    with Interrupt() as interrupt, Live(console=Console(), auto_refresh=False) as live:
        while not interrupt.happened:
            fleet.update()
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + REFRESH_S
                lines = robot_lines(fleet.robots) if fleet.robots else [warning("no robot answers")]
                live.update(Text.from_ansi("\n".join(lines)), refresh=True)
    fleet.close()
