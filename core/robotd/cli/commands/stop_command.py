"""``robotd stop``: stop all motion of a running robot."""

from __future__ import annotations

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("stop", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def stop(ctx: click.Context, /, timeout_s: float) -> None:
    """Stop all motion of the running robot, until a reset.

    Goals, moves, jogs, homing and the base come to rest by their own ramps, goals on their path.
    Motion is rejected until 'robotd reset'. No safety function.
    """
    configure_logging(ctx)
    with robot_client(ros_args(ctx), timeout_s) as client:
        click.echo(import_ros("client.operator_client").stop(client))
    ctx.exit(ExitCode.OK)
