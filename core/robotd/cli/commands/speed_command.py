"""``robotd speed``: set the speed of all motion of a running robot."""

from __future__ import annotations

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging, not_nan
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("speed", epilog=ROS_EPILOG)
@click.argument("percent", type=click.FloatRange(0, 100), callback=not_nan)
@client_options
@click.pass_context
def speed(ctx: click.Context, /, percent: float, timeout_s: float) -> None:
    """Set the speed of all motion of the running robot, 0 to 100 %.

    Goals keep their paths: velocities and accelerations scale, by ramps, also while they move. 0
    holds on the path. Moves, jogs and streams take the speed at their start.
    """
    configure_logging(ctx)
    with robot_client(ros_args(ctx), timeout_s) as client:
        click.echo(import_ros("client.operator_client").set_speed(client, percent / 100.0))
    ctx.exit(ExitCode.OK)
