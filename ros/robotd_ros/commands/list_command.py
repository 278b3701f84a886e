"""``robotd list``: the running robots of the ROS domain."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from robotd.cli.layout import columns
from robotd.cli.options import as_json
from robotd.cli.preflight import import_ros
from robotd_ros.commands.robot_client import ROS_EPILOG, client_options, robot_client

SETTLE_S = 1.0  # for the discovery of what runs


@click.command("list", epilog=ROS_EPILOG)
@as_json
@client_options
def list_robots(timeout_s: float, *, as_json: bool) -> None:
    """List the running robots of the ROS domain."""
    with robot_client(timeout_s, searches=True) as client:
        identity = import_ros("robotd_ros.client.robot_identity")
        robots = identity.find_robots(client, SETTLE_S)
    if as_json:
        click.echo(json.dumps([asdict(robot) for robot in robots], indent=2))
    elif robots:
        rows = [("robot", "namespace", "backend", "variant", "computer", "robotd", "")]
        rows += [
            (
                robot.robot,
                robot.namespace,
                robot.backend,
                robot.variant or "-",
                robot.computer,
                robot.version,
                "SIMULATED" if robot.simulated else "",
            )
            for robot in robots
        ]
        click.echo("\n".join(columns(rows)))
    else:
        click.echo("no robot runs in this ROS domain", err=True)
