"""``robotd pause``: bring motion of a running robot to rest on its path."""

from __future__ import annotations

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import ROS_EPILOG, client_options, robot_client


@click.command("pause", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def pause(ctx: click.Context, /, timeout_s: float) -> None:
    """Bring motion to rest on its path, to be resumed.

    Goals stay active; their clients may give up waiting. Streams end.
    """
    configure_logging(ctx)
    with robot_client(ros_args(ctx), timeout_s) as client:
        click.echo(import_ros("client.operator_client").pause(client))
    ctx.exit(ExitCode.OK)
