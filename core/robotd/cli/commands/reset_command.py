"""``robotd reset``: allow motion again after a stop."""

from __future__ import annotations

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("reset", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def reset(ctx: click.Context, /, timeout_s: float) -> None:
    """Allow motion again after a stop. Nothing moves.

    A stop input has to allow motion before. Clients have to command motion anew.
    """
    configure_logging(ctx)
    with robot_client(ros_args(ctx), timeout_s) as client:
        click.echo(import_ros("client.operator_client").reset(client))
    ctx.exit(ExitCode.OK)
